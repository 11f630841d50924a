"""Observations of links by robots at rest: kinds of packets that they decoded or missed.

A kind is the packet's outcome, its sender, and the bin of the margin with which it was expected.
"""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.links import Links
from swarm_mj.system.decibels import DB_PER_NEPER, to_db

BIN_DB = 2.0
LEAST_MARGIN_DB = -15.0  # of the lowest bin; packets that are expected to be weaker are not missed
NUM_BINS = 24
NOTHING = -1  # in place of the kind of a packet
MISSED = 0  # outcomes of a packet
DECODED = 1
NUM_OUTCOMES = 2
MAX_KINDS = 64  # that one robot notes
MAX_TIMES = 255  # that it notes one kind
DOUBTFUL_STDS = 3.0  # of the margin by errors of positions, within which outcomes say nothing
Counts = Int[np.ndarray, "N N K"]  # packets of i that j decoded, or missed, by bins of margin


def observe(
    listens: Bool[np.ndarray, "N"],
    heard: Int[np.ndarray, "N"],
    transmitted: Bool[np.ndarray, "N"],
    believed_mw: Float[np.ndarray, "N N"],
    prior: Links,
) -> Int[np.ndarray, "N"]:
    """Return the kind of packet that each robot notes of a slot in which it followed one plan.

    Only those listen here that know that all others follow plans, too; nobody else can say what was
    in the air. The plan was made by believed powers of i at j, [i, j]. Margins are counted from the
    links before anything was learned.
    """
    num_robots = len(heard)
    everyone = np.arange(num_robots)
    is_other = ~np.eye(num_robots, dtype=bool)
    arriving_mw = np.where(transmitted[:, None] & is_other, believed_mw, 0.0)  # of i at j
    is_decoded = heard != everyone
    # Whose packet it was: of one that was missed, the strongest that should have arrived.
    sender = np.where(is_decoded, heard, np.argmax(arriving_mw, axis=0))
    # A sum of its own: the packet that j decoded need not be the strongest by this belief.
    is_sender = everyone[:, None] == sender
    others_mw = np.sum(np.where(is_sender, 0.0, arriving_mw), axis=0)
    sinr = prior.received_mw[sender, everyone] / (prior.noise_mw + others_mw)
    margin = sinr / prior.threshold
    margin_db = to_db(np.maximum(margin, np.finfo(np.float64).tiny))
    nearest = np.floor((margin_db - LEAST_MARGIN_DB) / BIN_DB + 0.5).astype(np.int64)
    # A packet too weak for the lowest bin tells something if it is decoded, nothing if it is not.
    is_missed = np.any(arriving_mw > 0.0, axis=0) & (nearest >= 0)
    outcome = np.where(is_decoded, DECODED, MISSED)
    bins = np.clip(nearest, 0, NUM_BINS - 1)
    kind = np.ravel_multi_index((outcome, sender, bins), _kinds(num_robots))
    # Where the error of positions may well have decided, a packet teaches nothing of the channel.
    # Power falls with the distance squared.
    doubt_db = DOUBTFUL_STDS * 2.0 * DB_PER_NEPER / prior.distance_over_std[sender, everyone]
    is_telling = (is_decoded | is_missed) & (np.abs(margin_db) >= doubt_db)
    return np.where(listens & is_telling, kind, NOTHING)


def _kinds(num_robots: int) -> tuple[int, int, int]:
    """Return the shape of an array by kinds of packets: by outcome, sender and bin of the margin.

    A kind is a place in such an array, counted on row by row.
    """
    return NUM_OUTCOMES, num_robots, NUM_BINS


class Evidence:
    """All observations of a team, slot by slot."""

    def __init__(self, num_robots: int) -> None:
        self._slots: list[Int[np.ndarray, " N"]] = []  # the kind that j noted in each
        # [j, kind]: how often j noted each.
        self._times = np.zeros((num_robots, math.prod(_kinds(num_robots))), dtype=np.int64)

    def add(self, kinds: Int[np.ndarray, "N"]) -> None:
        """Note the next slot; robots whose notes are full count on only the kinds they have."""
        j = np.flatnonzero(kinds != NOTHING)
        times = self._times[j, kinds[j]]
        # Packets have room for MAX_KINDS kinds: a robot that has them all notes no other.
        has_room = np.count_nonzero(self._times[j], axis=1) < MAX_KINDS
        is_noted = np.where(times == 0, has_room, times < MAX_TIMES)
        self._times[j, kinds[j]] += is_noted
        self._slots.append(kinds.copy())
        self._slots[-1][j[~is_noted]] = NOTHING

    def counts(self, known_until: Int[np.ndarray, "N"]) -> tuple[Counts, Counts]:
        """Return how many packets were decoded, and missed, until each robot's last slot."""
        num_robots = len(known_until)
        kinds = np.array(self._slots, dtype=np.int64).reshape(-1, num_robots)  # [slot, j]
        is_past = np.arange(len(kinds))[:, None] <= known_until
        slot, j = np.nonzero((kinds != NOTHING) & is_past)
        times = np.zeros_like(self._times)
        # Unlike `+=`, this counts each time that a robot noted the same kind.
        np.add.at(times, (j, kinds[slot, j]), 1)
        by_outcome = times.reshape(num_robots, *_kinds(num_robots))
        return by_outcome[:, DECODED], by_outcome[:, MISSED]
