"""Evidence of links: packets that robots decoded or missed, by the margin these should have.

A robot that knows the schedule knows who transmitted in the slot before, and so which packet it
should have decoded. Index order: `[j, i]`: robot j listens to robot i. Margins are counted in bins.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.links import Links
from swarm_mj.radio.reception import NOBODY, Incoming, add_packet, sinr
from swarm_mj.system.compiled import compiled

BIN_DB = 2.0
LEAST_MARGIN_DB = -15.0  # of the lowest bin; packets that are expected to be weaker are not missed
NUM_BINS = 24

MAX_KINDS = 64  # kinds of packets, by sender, margin and fate, that one robot notes
MAX_TIMES = 255  # that it notes one kind

Counts = Int[np.ndarray, "N N K"]  # packets of i that j decoded, or missed, by bins of margin


class Observation(NamedTuple):
    """The evidence of one slot: at most one packet for every robot."""

    sender: Int[np.ndarray, "N"]  # of the packet, or `NOBODY`
    margin: Int[np.ndarray, "N"]  # its bin
    is_decoded: Bool[np.ndarray, "N"]


def no_observation(num_robots: int) -> Observation:
    """Return that of robots that learned nothing."""
    return Observation(
        np.full(num_robots, NOBODY),
        np.zeros(num_robots, dtype=np.int64),
        np.zeros(num_robots, bool),
    )


def bin_centres_db() -> Float[np.ndarray, "K"]:
    """Return the margin in the middle of every bin [dB]."""
    return LEAST_MARGIN_DB + BIN_DB * np.arange(NUM_BINS)


@compiled()
def observe(
    listens: Bool[np.ndarray, "N"],
    heard: Int[np.ndarray, "N"],
    transmitted: Bool[np.ndarray, "N"],
    believed_mw: Float[np.ndarray, "N N"],
    prior: Links,
    observation: Observation,
) -> None:
    """Fill in what these robots learn from a slot in which they followed one plan.

    Args:
        listens: Robots that followed the plan, did not transmit, and know that all others follow
            plans, too; nobody else can say what was in the air.
        heard: The sender that each robot decoded; itself: none.
        transmitted: The transmitters by the plan.
        believed_mw: Power of i at j by which the plan was made, [i, j] [mW].
        prior: Links before anything was learned; margins are counted from there.
        observation: Written in place, for these robots.
    """
    num_robots = heard.shape[0]
    for j in range(num_robots):
        if not listens[j]:
            continue
        is_decoded = heard[j] != j
        i = heard[j] if is_decoded else _strongest(j, transmitted, believed_mw)
        if i == NOBODY:
            continue
        # A sum of its own: the packet that j decoded need not be the strongest by this belief.
        others_mw = 0.0
        for k in range(num_robots):
            if transmitted[k] and k != i and k != j:
                others_mw += believed_mw[k, j]
        ratio = sinr(prior.received_mw[i, j], others_mw, prior.noise_mw)
        margin_db = 10.0 * math.log10(ratio / prior.threshold)
        place = math.floor((margin_db - LEAST_MARGIN_DB) / BIN_DB + 0.5)
        if is_decoded or place >= 0:
            observation.sender[j] = i
            observation.margin[j] = min(max(place, 0), NUM_BINS - 1)
            observation.is_decoded[j] = is_decoded


@compiled()
def _strongest(
    j: int, transmitted: Bool[np.ndarray, "N"], believed_mw: Float[np.ndarray, "N N"]
) -> int:
    """Return the sender of the packet that j should have decoded, or `NOBODY`."""
    incoming = Incoming(0.0, 0.0, NOBODY)
    for i in range(transmitted.shape[0]):
        if transmitted[i] and i != j:
            incoming = add_packet(incoming, i, believed_mw[i, j], believed_mw[i, j])
    return incoming.sender


class Evidence:
    """All observations of a team, slot by slot."""

    def __init__(self, num_robots: int) -> None:
        self._slots: list[Observation] = []
        # How often j noted that it decoded (1) or missed (0) a packet of i, by bins.
        self._times = np.zeros((2, num_robots, num_robots, NUM_BINS), dtype=np.int64)
        self._num_kinds = np.zeros(num_robots, dtype=np.int64)

    def add(self, observation: Observation) -> None:
        """Note the observation of the next slot; full notes count on only what they have."""
        sender, margin, is_decoded = observation
        j = np.flatnonzero(sender != NOBODY)
        kind = is_decoded[j].astype(np.int64), j, sender[j], margin[j]
        is_new = self._times[kind] == 0
        is_noted = np.where(is_new, self._num_kinds[j] < MAX_KINDS, self._times[kind] < MAX_TIMES)
        self._num_kinds[j] += is_new & is_noted
        self._times[kind] += is_noted
        sender[j[~is_noted]] = NOBODY
        self._slots.append(observation)

    def counts(self, known_until: Int[np.ndarray, "N"]) -> tuple[Counts, Counts]:
        """Return how many packets were decoded, and how many missed.

        Args:
            known_until: The last slot that counts, robot by robot.
        """
        decoded, missed = np.zeros_like(self._times)
        if self._slots:
            columns = zip(*self._slots, strict=True)
            sender, margin, is_decoded = (np.stack(column) for column in columns)
            is_noted = np.arange(len(sender))[:, None] <= known_until[None, :]
            is_noted &= sender != NOBODY
            for table, is_meant in ((decoded, is_decoded), (missed, ~is_decoded)):
                slot, j = np.nonzero(is_meant & is_noted)
                np.add.at(table, (j, sender[slot, j], margin[slot, j]), 1)
        return decoded, missed
