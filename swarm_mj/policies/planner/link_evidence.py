"""Evidence of links: packets that robots decoded or missed, by the margin these should have.

A robot that knows the schedule knows who transmitted in the slot before, and so which packet it
should have decoded. It notes the kind of that packet: its sender, its margin in bins, and whether
it was decoded. Index order: `[j, i]`: robot j listens to robot i.
"""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.links import Links
from swarm_mj.radio.reception import NOBODY, Incoming, add_packet, sinr
from swarm_mj.system.compiled import compiled

BIN_DB = 2.0
LEAST_MARGIN_DB = -15.0  # of the lowest bin; packets that are expected to be weaker are not missed
NUM_BINS = 24

NOTHING = -1  # in place of the kind of a packet
MAX_KINDS = 64  # that one robot notes
MAX_TIMES = 255  # that it notes one kind

Counts = Int[np.ndarray, "N N K"]  # packets of i that j decoded, or missed, by bins of margin


@compiled()
def kind_of(is_decoded: bool, i: int, margin: int, num_robots: int) -> int:
    """Return the number of a kind of packet: of sender i, in this bin of margins."""
    return ((1 if is_decoded else 0) * num_robots + i) * NUM_BINS + margin


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
    kinds: Int[np.ndarray, "N"],
) -> None:
    """Write the kind of packet that each robot notes of a slot in which it followed one plan.

    Args:
        listens: Robots that followed the plan, did not transmit, and know that all others follow
            plans, too; nobody else can say what was in the air.
        heard: The sender that each robot decoded; itself: none.
        transmitted: The transmitters by the plan.
        believed_mw: Power of i at j by which the plan was made, [i, j] [mW].
        prior: Links before anything was learned; margins are counted from there.
        kinds: Written for these robots.
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
            kinds[j] = kind_of(is_decoded, i, min(max(place, 0), NUM_BINS - 1), num_robots)


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
