"""Plans: who should transmit in each slot, computed as far as they are asked for.

News has heuristic weights, by hand, from the graph of links that a scheduler believes. Index order:
row `i` sends or is passed through, column `j` or `k` is reached or is the subject.
"""

import math

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.planner.broadcast_scheduler import Lookahead, Weights, schedule
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import Snapshots
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.links import Links, lone_probabilities
from swarm_mj.radio.mission_radio import Belief
from swarm_mj.system.compiled import compiled

CHUNK_SLOTS = 10  # planned at a time, whatever is asked for; any number gives the same plan


class Plan:
    """The transmitters of each slot, numbered from 0, between robots that stand still.

    Without more arguments, the plan is endless and begins with a team that knows nothing.
    """

    def __init__(
        self,
        links: Links,
        settings: PlannerSettings,
        *,
        is_certain: bool | None = None,
        timestamp: Float[np.ndarray, "N N"] | None = None,
        now: float = 0.0,
        is_free: Bool[np.ndarray, "P"] | None = None,
    ) -> None:
        """Prepare a plan that begins with T and t [windows], and ends with the slots, free or not.

        It looks as far ahead as on certain links if that is said, or else if its links are.
        """
        num_robots = len(links.received_mw)
        is_certain = not links.is_doubtful if is_certain is None else is_certain
        timestamp = np.full((num_robots, num_robots), NEVER) if timestamp is None else timestamp
        self._links, self._weights = links, heuristic_weights(links, settings)
        self._lookahead = lookahead_of(num_robots, is_certain=is_certain, settings=settings)
        self._timestamp = (SLOTS_PER_WINDOW * timestamp).astype(np.float32)  # [slots]
        self._now = SLOTS_PER_WINDOW * now
        self._num_slots = math.inf if is_free is None else len(is_free)
        self._is_free = np.ones(0, dtype=bool) if is_free is None else is_free
        self._transmits = []  # by slots

    def transmits(self, slot: int) -> Bool[np.ndarray, "N"]:
        """Return who transmits in a slot, or raise IndexError if the plan ends before."""
        if slot >= self._num_slots:
            raise IndexError(f"the plan has {self._num_slots} slots")
        while slot >= len(self._transmits):
            self._extend()
        return self._transmits[slot]

    def outcome(self) -> Float[np.ndarray, "N N"]:
        """Return T after the last slot of a plan that ends, as expected [windows]."""
        assert math.isfinite(self._num_slots)
        while len(self._transmits) < self._num_slots:
            self._extend()
        return self._timestamp.astype(np.float64) / SLOTS_PER_WINDOW

    def _extend(self) -> None:
        begin, num_robots = len(self._transmits), len(self._timestamp)
        num_slots = int(min(CHUNK_SLOTS, self._num_slots - begin))
        # Looking ahead reaches beyond these slots, and beyond the plan's end, where all are free.
        is_free = np.ones(num_slots + self._lookahead.depth, dtype=bool)
        known = self._is_free[begin : begin + len(is_free)]
        is_free[: len(known)] = known
        transmits, now = np.empty((num_slots, num_robots), dtype=bool), self._now + begin
        network = self._links, self._weights, self._lookahead
        schedule(self._timestamp, now, *network, is_free, transmits)
        self._transmits.extend(transmits)


def lookahead_of(num_robots: int, *, is_certain: bool, settings: PlannerSettings) -> Lookahead:
    """Return how far a team of this size looks ahead, on certain or on merely believed links."""
    if num_robots > settings.max_lookahead_robots:
        return Lookahead(1, 1)
    return Lookahead(*(settings.rest_lookahead if is_certain else settings.moving_lookahead))


def epoch_plan(
    belief: Belief,
    settings: PlannerSettings,
    snapshots: Snapshots,
    owner: int,
    timestamp: Float[np.ndarray, "N N"],
    now: float,
    is_free: Bool[np.ndarray, "P"],
) -> Plan:
    """Return the plan of an epoch that begins with T and t [windows], by one robot's snapshot."""
    is_fresh, observed = snapshots.is_fresh[owner], snapshots.timestamp[owner]
    round_windows = max(len(observed), settings.min_round_windows)
    is_gone = now - observed > settings.gone_rounds * round_windows
    is_there = snapshots.is_known[owner] & (is_fresh | ~is_gone)
    std_m = snapshots.position_std_m[owner]
    # The last plan may have expected news of a robot that went missing. In truth nobody knows
    # anything newer of it than the snapshot does, nor does it know anything newer itself.
    newest = np.where(is_fresh, np.inf, observed)
    return Plan(
        belief.links(snapshots.position_m[owner], std_m, is_there),
        settings,
        is_certain=not np.any(std_m),
        timestamp=np.minimum(timestamp, np.minimum(newest[:, None], newest[None, :])),
        now=now,
        is_free=is_free,
    )


def heuristic_weights(links: Links, settings: PlannerSettings) -> Weights:
    """Return the weights of squared rises of T: more at receivers that many robots lie behind.

    Squares prefer the stalest entries to many small refreshments. A receiver that passes news on to
    many others should get it early. The denser the links, the smaller the share of a slot's value
    that must remain when another robot transmits, and so the more robots transmit at once. Where
    links or positions are doubtful or a robot has no link, plans should not rely on every packet.
    """
    probability = lone_probabilities(links)
    is_linked = probability >= settings.min_probability
    has_link = np.any(is_linked, axis=1)
    hops = expected_hops(np.where(is_linked, probability, 0.0))
    behind = np.maximum(num_downstream(hops, settings.slack_hops), 1.0)
    weight = behind**settings.downstream_exponent
    weight *= np.clip(hops, 1.0, len(weight)) ** settings.hops_exponent
    share = settings.share_unlinked
    total, num_linked = float(np.sum(probability)), int(np.sum(has_link))
    if not links.is_doubtful:
        share += settings.share_per_link * total / max(1, num_linked * (num_linked - 1))
    doubt = np.sum(probability / links.distance_over_std) / max(total, settings.min_probability)
    share += settings.share_per_std * float(doubt)
    share += 0.0 if np.all(has_link) else settings.share_isolated
    return Weights(weight.astype(np.float32), min(share, settings.max_share))


def expected_hops(probability: Float[np.ndarray, "N N"]) -> Float[np.ndarray, "N N"]:
    """Return the expected transmissions from i to j by shortest paths; inf out of reach."""
    # A link of probability p takes 1 / p transmissions.
    hops = np.divide(1.0, probability, out=np.full_like(probability, np.inf), where=probability > 0)
    np.fill_diagonal(hops, 0.0)
    for via in range(len(hops)):  # Floyd and Warshall
        hops = np.minimum(hops, hops[:, via, None] + hops[via])
    return hops


@compiled()
def num_downstream(hops: Float[np.ndarray, "N N"], slack: float) -> Float[np.ndarray, "N N"]:
    """Return how many robots lie behind i for news of k, i itself among them; 0 out of reach."""
    num_robots = hops.shape[0]
    behind = np.zeros((num_robots, num_robots))
    for i in range(num_robots):
        for k in range(num_robots):
            if hops[k, i] < np.inf:
                for j in range(num_robots):
                    if hops[k, j] < np.inf:
                        detour = hops[k, i] + hops[i, j] - hops[k, j]
                        behind[i, k] += 1.0 if detour < slack else 0.0
    return behind
