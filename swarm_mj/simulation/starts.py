"""The start of missions: where robots begin."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import HEIGHT, PLANE
from swarm_mj.mission.placement import connected_positions
from swarm_mj.physics.state import ROBOT_HEIGHT_M
from swarm_mj.physics.worlds import Worlds
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.obstruction import blocked

MAX_DRAWN_AT_ONCE = 1000  # robots of a team that is drawn anew as a whole until it is connected


@dataclass(frozen=True)
class Starts:
    """Where the robots of missions may begin."""

    mission: Mission
    worlds: Worlds
    channel: ComposedChannel | None  # that says who is connected; None: distances say it

    def positions(self, b: int, rng: np.random.Generator) -> Float[np.ndarray, "N D"]:
        """Draw where mission b's robots begin, connected under their channel where it can say."""
        mission = self.mission
        channel = self.channel
        has_obstacles = self.worlds.obstacles is not None
        return connected_positions(
            num_robots=mission.num_robots,
            half_side_m=mission.half_side_m,
            range_m=mission.range_m,
            rng=rng,
            largest_part_at=partial(channel.largest_part, mission=b) if channel else None,
            is_blocked_at=self.is_blocked if has_obstacles or mission.collide else None,
            keeps_largest=has_obstacles or mission.num_robots > MAX_DRAWN_AT_ONCE,
            height_m=self.worlds.draw_heights_m(rng),
        )

    def is_blocked(self, position_m: Float[np.ndarray, "N D"]) -> Bool[np.ndarray, "N"]:
        """Return which robots would touch an obstacle there, or another robot if they collide."""
        is_hit = np.zeros(len(position_m), dtype=bool)
        height_m = np.full(len(position_m), ROBOT_HEIGHT_M)
        if position_m.shape[1] > PLANE:
            height_m = position_m[:, HEIGHT].copy()
        reach_m = self.worlds.reach_m
        if self.worlds.obstacles is not None:
            is_hit = blocked(position_m, height_m, reach_m, self.worlds.obstacles)
        if self.mission.collide:
            apart_m = np.linalg.norm(position_m[:, np.newaxis] - position_m, axis=-1)
            needed_m = reach_m[:, np.newaxis] + reach_m
            overlaps = np.tril(apart_m < needed_m, k=-1)  # the first one may stay
            is_hit |= np.any(overlaps, axis=1)
        return is_hit
