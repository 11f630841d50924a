"""Evidence of links: packets that robots decoded or missed, by the margin these should have.

A robot that knows the schedule knows who transmitted in the slot before, and so which packet it
should have decoded. It notes the kind of that packet: its sender, its margin in bins, and whether
it was decoded. Index order: `[j, i]`: robot j listens to robot i.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.links import Links

BIN_DB = 2.0
LEAST_MARGIN_DB = -15.0  # of the lowest bin; packets that are expected to be weaker are not missed
NUM_BINS = 24
BIN_CENTRES_DB = LEAST_MARGIN_DB + BIN_DB * np.arange(NUM_BINS)

NOTHING = -1  # in place of the kind of a packet
MAX_KINDS = 64  # that one robot notes
MAX_TIMES = 255  # that it notes one kind

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
    everyone, is_other = np.arange(num_robots), ~np.eye(num_robots, dtype=bool)
    arriving_mw = np.where(transmitted[:, None] & is_other, believed_mw, 0.0)
    is_decoded = heard != everyone
    i = np.where(is_decoded, heard, np.argmax(arriving_mw, axis=0))
    # A sum of its own: the packet that j decoded need not be the strongest by this belief.
    others_mw = np.sum(np.where(everyone[:, None] == i, 0.0, arriving_mw), axis=0)
    margin = prior.received_mw[i, everyone] / (prior.noise_mw + others_mw) / prior.threshold
    margin_db = 10.0 * np.log10(np.maximum(margin, np.finfo(np.float64).tiny))
    place = np.floor((margin_db - LEAST_MARGIN_DB) / BIN_DB + 0.5).astype(np.int64)
    is_missed = np.any(arriving_mw > 0.0, axis=0) & (place >= 0)
    kind = (is_decoded * num_robots + i) * NUM_BINS + np.clip(place, 0, NUM_BINS - 1)
    return np.where(listens & (is_decoded | is_missed), kind, NOTHING)


class Evidence:
    """All observations of a team, slot by slot."""

    def __init__(self, num_robots: int) -> None:
        self._num_robots = num_robots
        self._slots: list[Int[np.ndarray, " N"]] = []  # the kind that j noted in each
        self._times = np.zeros((num_robots, 2 * num_robots * NUM_BINS), dtype=np.int64)
        self._num_kinds = np.zeros(num_robots, dtype=np.int64)

    def add(self, kinds: Int[np.ndarray, "N"]) -> None:
        """Note the next slot; robots whose notes are full count on only the kinds they have."""
        j = np.flatnonzero(kinds != NOTHING)
        times = self._times[j, kinds[j]]
        is_noted = np.where(times == 0, self._num_kinds[j] < MAX_KINDS, times < MAX_TIMES)
        self._num_kinds[j] += (times == 0) & is_noted
        self._times[j, kinds[j]] += is_noted
        self._slots.append(kinds.copy())
        self._slots[-1][j[~is_noted]] = NOTHING

    def counts(self, known_until: Int[np.ndarray, "N"]) -> tuple[Counts, Counts]:
        """Return how many packets were decoded, and missed, until each robot's last slot."""
        times = np.zeros_like(self._times)
        for slot, kinds in enumerate(self._slots):
            j = np.flatnonzero((slot <= known_until) & (kinds != NOTHING))
            times[j, kinds[j]] += 1
        missed, decoded = np.moveaxis(
            times.reshape(self._num_robots, 2, self._num_robots, NUM_BINS), 1, 0
        )
        return decoded, missed
