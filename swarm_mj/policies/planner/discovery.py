"""Who speaks while a plan does not say: the discovery of the team, and the search for the lost.

Both need only what is common before the mission: identities, the team's size and area, orders and
the clock. What robots hear meanwhile makes them more polite, not less.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.greedy_oracle.link_scheduler import HALVES
from swarm_mj.protocol.buffers import Buffers

SPEAKERS_PER_REACH = 0.4  # at once, while everyone speaks for the first time
MOST_SPEAKERS = 8
FAST_ROUNDS = 1  # times that everyone speaks with so many others
LATER_SHARE = 0.5  # of these speak at once from then on
POLITE = 1.5  # ranges within which a speaker known to come first silences another
NUM_ROUNDS = 40  # times that everyone speaks, after which the orders repeat
SEEK_AFTER = 5.0  # times N windows, after which robots are sought instead
LATEST_SEEK = 200  # windows: then in any case
SEEK_EVERY = 5  # windows, while robots are lost


class Discovery:
    """One mission's turns to speak; row i of every result depends on robot i's buffer alone."""

    def __init__(
        self, num_robots: int, num_reaches: float, range_m: float, rng: np.random.Generator
    ) -> None:
        """Draws the orders.

        Args:
            num_robots: N.
            num_reaches: Area over that within which a lone packet decodes [1].
            range_m: Distance up to which a lone packet decodes [m].
            rng: Of the mission.
        """
        self.num_robots = num_robots
        self._range_m = range_m
        self._order = rng.permutation(num_robots)
        self._place = np.argsort(self._order)
        at_once = int(np.clip(round(SPEAKERS_PER_REACH * num_reaches), 1, MOST_SPEAKERS))
        counts = [at_once] * FAST_ROUNDS + [max(1, int(at_once * LATER_SHARE))] * (
            NUM_ROUNDS - FAST_ROUNDS
        )
        self._groups = [
            group
            for count in counts
            for group in _groups(rng.permutation(num_robots), min(count, num_robots - 1))
        ]

    def is_discovered(self, half_window: int, is_complete: bool) -> bool:
        """Whether a half window is the discovery's, by a picture that has all robots or not."""
        return not is_complete and not self._is_late(half_window)

    def is_sought(self, half_window: int, is_fresh: Bool[np.ndarray, "N"]) -> bool:
        """Whether a half window is the search's, by a picture in which these are fresh."""
        if not self._is_late(half_window) or bool(np.all(is_fresh)):
            return False
        return (half_window // HALVES) % SEEK_EVERY == 0

    def speaks(self, half_window: int, buffers: Buffers, b: int) -> Bool[np.ndarray, "N"]:
        """The robots whose turn it is, but those who know one near them that comes before."""
        group = self._groups[half_window % len(self._groups)]
        speaks = np.zeros(self.num_robots, dtype=bool)
        for turn, i in enumerate(group.tolist()):
            before = group[:turn]
            is_near = self._are_near(buffers, b, i, buffers.position_m[b, i, i], POLITE)
            speaks[i] = not np.any(is_near[before])
        return speaks

    def seeks(
        self,
        half_window: int,
        is_fresh: Bool[np.ndarray, "N"],
        was_fresh: Bool[np.ndarray, "*rows N"],
        heard: Int[np.ndarray, "N"],
        buffers: Buffers,
        b: int,
    ) -> Bool[np.ndarray, "N"]:
        """In the first half of a window one robot of all; in the second those who found someone.

        Args:
            half_window: The half window.
            is_fresh: Who is, in the picture that a robot flies by.
            was_fresh: Who was, in the picture that robot i flew by before it decoded somebody.
            heard: Whom each robot decoded in the half window before.
            buffers: All robots'.
            b: The mission.

        Returns:
            Who speaks. A robot that has just heard someone lost answers, unless another one near
            that robot comes first; of the lost who hold this picture, one after the other speaks.
        """
        speaks = np.zeros(self.num_robots, dtype=bool)
        turn = half_window // HALVES // SEEK_EVERY
        if half_window % HALVES == 0:
            speaks[self._order[turn % self.num_robots]] = True
            return speaks
        lost = self._order[~is_fresh[self._order]]
        speaks[lost[turn % len(lost)]] = True
        was_fresh = np.broadcast_to(was_fresh, (self.num_robots, self.num_robots))
        everyone = np.arange(self.num_robots)
        has_found = (heard != everyone) & ~was_fresh[everyone, heard]
        for i in np.flatnonzero(has_found).tolist():
            found = heard[i]
            could = self._are_near(buffers, b, i, buffers.position_m[b, i, found], 1.0)
            could &= was_fresh[i]
            speaks[i] = not np.any(could & (self._place < self._place[i]))
        return speaks

    def _is_late(self, half_window: int) -> bool:
        return half_window >= HALVES * min(SEEK_AFTER * self.num_robots, LATEST_SEEK)

    def _are_near(
        self, buffers: Buffers, b: int, i: int, position_m: Float[np.ndarray, "2"], ranges: float
    ) -> Bool[np.ndarray, "N"]:
        """Whom i knows within so many ranges of a place."""
        apart_m = buffers.position_m[b, i] - position_m
        is_near = np.hypot(apart_m[:, 0], apart_m[:, 1]) < ranges * self._range_m
        return is_near & buffers.is_known[b, i]


def _groups(order: Int[np.ndarray, "N"], count: int) -> list[Int[np.ndarray, "K"]]:
    """An order cut into groups that speak at the same time."""
    return [order[begin : begin + count] for begin in range(0, len(order), count)]
