"""Plans: who should transmit in each slot, computed as far as they are asked for.

News has heuristic weights, by hand, from the graph of links that a scheduler believes. Index order:
row `i` sends or is passed through, column `j` or `k` is reached or is the subject.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.planner.broadcast_scheduler import Problem, schedule_slot
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import Snapshots
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW
from swarm_mj.radio.links import Links, lone_probabilities
from swarm_mj.radio.mission_radio import Belief

ALL_FREE = np.ones(0, dtype=bool)  # slots beyond those that are named are free


class Plan:
    """The transmitters of each slot, numbered from 0, between robots that stand still.

    Without more arguments, it begins with a team that knows nothing. It has no end: slots are
    planned as they are asked for.
    """

    def __init__(
        self,
        links: Links,
        settings: PlannerSettings,
        *,
        is_certain: bool | None = None,
        timestamp: Float[np.ndarray, "N N"] | None = None,
        now: float = 0.0,
        is_free: Bool[np.ndarray, "P"] = ALL_FREE,
        links_from: Callable[[int], Links] | None = None,
    ) -> None:
        """Prepare a plan that begins with T and t [windows], and in which some slots are not free.

        It looks as far ahead as on certain links if that is said, or else if its links are. Links
        may be others from some slots on, every `settings.drawn_slots`.
        """
        if is_certain is None:
            is_certain = not links.is_doubtful
        if timestamp is None:
            timestamp = np.full_like(links.received_mw, NEVER)
        self._problem_of = partial(problem_of, settings=settings, is_certain=is_certain)
        self._problem = self._problem_of(links)
        self._links_from = links_from
        self._drawn_slots = settings.drawn_slots
        self._timestamp = (SLOTS_PER_WINDOW * timestamp).astype(np.float32)  # [slots]
        self._now = SLOTS_PER_WINDOW * now
        self._is_free = is_free
        self._transmits = []  # by slots

    def transmits(self, slot: int) -> Bool[np.ndarray, "N"]:
        """Return who transmits in a slot."""
        self._plan(slot + 1)
        return self._transmits[slot]

    def outcome(self) -> Float[np.ndarray, "N N"]:
        """Return T after the last slot of which it was said whether it is free [windows]."""
        self._plan(len(self._is_free))
        assert len(self._transmits) == len(self._is_free)
        return self._timestamp.astype(np.float64) / SLOTS_PER_WINDOW

    def _plan(self, num_slots: int) -> None:
        for slot in range(len(self._transmits), num_slots):
            if self._links_from is not None and slot % self._drawn_slots == 0:
                self._problem = self._problem_of(self._links_from(slot))
            named = self._is_free[slot : slot + self._problem.depth]
            is_free = np.ones(self._problem.depth, dtype=bool)
            is_free[: len(named)] = named
            now = self._now + slot + 1.0
            self._transmits.append(schedule_slot(self._timestamp, now, self._problem, is_free))


def epoch_plan(
    snapshots: Snapshots,
    owner: int,
    belief: Belief,
    settings: PlannerSettings,
    *,
    timestamp: Float[np.ndarray, "N N"],
    now: float,
    is_free: Bool[np.ndarray, "P"],
) -> Plan:
    """Return the plan of an epoch that begins with T and t [windows], by one robot's snapshot."""
    is_fresh = snapshots.is_fresh[owner]
    observed = snapshots.timestamp[owner]
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


def problem_of(links: Links, settings: PlannerSettings, *, is_certain: bool) -> Problem:
    """Return what schedules over these links follow from, with heuristic weights of news.

    Squared rises of T prefer the stalest entries to many small refreshments. They weigh more at
    receivers that many robots lie behind, for a receiver that passes news on to many others should
    get it early. On certain links looking further ahead pays.
    """
    lone = lone_probabilities(links)
    num_robots = len(links.received_mw)
    hops = expected_hops(np.where(lone >= settings.min_probability, lone, 0.0))
    behind = np.maximum(num_downstream(hops, settings.slack_hops), 1.0)
    weight = behind**settings.downstream_exponent
    weight *= np.clip(hops, 1.0, num_robots) ** settings.hops_exponent
    width, depth = settings.rest_lookahead if is_certain else settings.moving_lookahead
    if num_robots > settings.max_lookahead_robots:
        width = 1
        depth = 1
    return Problem(
        links=links,
        lone=lone,
        weight=weight.astype(np.float32),
        min_share=_min_share(links, lone, settings),
        width=width,
        depth=depth,
    )


def over_other_links(problem: Problem, links: Links) -> Problem:
    """Return the same problem a little later, with the weights that it had: they take longest."""
    return problem._replace(links=links, lone=lone_probabilities(links))


def _min_share(links: Links, lone: Float[np.ndarray, "N N"], settings: PlannerSettings) -> float:
    """Return the share of a slot's value that must remain when another robot transmits.

    The denser the links, the smaller it is, and so the more robots transmit at once. Where links or
    positions are doubtful or a robot has no link, plans should not rely on every packet.
    """
    has_link = np.any(lone >= settings.min_probability, axis=1)
    total = float(np.sum(lone))
    num_linked = int(np.sum(has_link))
    share = settings.share_unlinked
    if not links.is_doubtful:
        share += settings.share_per_link * total / max(1, num_linked * (num_linked - 1))
    doubt = np.sum(lone / links.distance_over_std) / max(total, settings.min_probability)
    share += settings.share_per_std * float(doubt)
    if not np.all(has_link):
        share += settings.share_isolated
    return min(share, settings.max_share)


def expected_hops(probability: Float[np.ndarray, "N N"]) -> Float[np.ndarray, "N N"]:
    """Return the expected transmissions from i to j by shortest paths; inf out of reach."""
    # A link of probability p takes 1 / p transmissions.
    hops = np.divide(1.0, probability, out=np.full_like(probability, np.inf), where=probability > 0)
    np.fill_diagonal(hops, 0.0)
    for via in range(len(hops)):  # Floyd and Warshall
        hops = np.minimum(hops, hops[:, via, None] + hops[via])
    return hops


def num_downstream(hops: Float[np.ndarray, "N N"], slack: float) -> Float[np.ndarray, "N N"]:
    """Return how many robots lie behind i for news of k, i itself among them; 0 out of reach."""
    behind = np.empty_like(hops)
    with np.errstate(invalid="ignore"):  # where j is out of reach: inf - inf is below no slack
        for k in range(len(hops)):
            detour = hops[k, :, None] + hops - hops[k]  # [i, j]: of k's news to j through i
            behind[:, k] = np.sum(detour < slack, axis=1)
    return behind
