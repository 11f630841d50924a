"""What a video shows of a mission, window by window; a replay's file holds it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from swarm_mj.mission import Mission
from swarm_mj.replay import palette
from swarm_mj.replay.frame import Frame, frame
from swarm_mj.replay.links import fates
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.shots import Shots, shots


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What does not change in a mission."""

    mission: Mission
    policy: str
    seed: int
    observer: int
    is_broadcast: bool
    full_scale: float  # the age from which robots are darkest [windows]


@dataclass(frozen=True, kw_only=True)
class Footage:
    """T windows of N robots."""

    facts: Facts
    window: Int[np.ndarray, "T"]  # 1 is the mission's first
    position_m: Float[np.ndarray, "T N 2"]  # p [m]
    velocity_mps: Float[np.ndarray, "T N 2"]  # of any length: only its direction is shown
    colour: UInt8[np.ndarray, "T N 3"]
    shots: Shots
    age_mean: Float[np.ndarray, "T"]  # Eq. 10 [windows]

    @property
    def frame(self) -> Frame:
        """The part of the ground that is shown."""
        return frame(self.position_m, self.facts.mission.half_side_m)


def facts_of(log: Log, mission: Mission, policy: str, seed: int) -> Facts:
    """What does not change in a mission that was recorded."""
    return Facts(
        mission=mission,
        policy=policy,
        seed=seed,
        observer=log.ego,
        is_broadcast=log.is_broadcast,
        full_scale=palette.nice_scale(log.age),
    )


def footage_of(log: Log, mission: Mission, policy: str, seed: int) -> Footage:
    """What a video shows of a mission that was recorded.

    Args:
        log: What was flown.
        mission: Its numbers.
        policy: Its name, for the title.
        seed: The mission's.
    """
    facts = facts_of(log, mission, policy, seed)
    age, is_known = log.ego_age, log.is_known
    return Footage(
        facts=facts,
        window=log.window,
        position_m=log.position_m,
        velocity_mps=log.velocity_mps,
        colour=palette.robot_colours(age, facts.full_scale, is_known, log.is_on, log.ego),
        shots=shots(fates(log), log.position_m),
        age_mean=log.age_mean,
    )
