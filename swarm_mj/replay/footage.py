"""What a video shows of a mission, window by window; a replay's file holds it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from swarm_mj.mission import Mission
from swarm_mj.mission.components import Components, components_in
from swarm_mj.physics.scene import Scene
from swarm_mj.replay import palette
from swarm_mj.replay.frame import Frame, frame
from swarm_mj.replay.links import fates
from swarm_mj.replay.looks import NO_SURPRISES, Looks, Surprises
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
    channel: str | None = None  # the names of the user's own parts
    controller: str | None = None
    scene: str | None = None

    @property
    def own_parts(self) -> list[str]:
        """Which are the user's own, in words."""
        return [f"{kind} {name}" for kind, name in components_in(vars(self)).names.items()]


@dataclass(frozen=True, kw_only=True)
class Footage:
    """T windows of N robots."""

    facts: Facts
    window: Int[np.ndarray, "T"]  # 1 is the mission's first
    position_m: Float[np.ndarray, "T N 2"]  # p [m]
    velocity_mps: Float[np.ndarray, "T N 2"]  # of any length: only its direction is shown
    age: Float[np.ndarray, "T N"]  # of what the observer knows [windows]; nan: nothing
    is_on: Bool[np.ndarray, "T N"]  # whether a robot was switched on
    shots: Shots
    age_mean: Float[np.ndarray, "T"]  # Eq. 10 [windows]
    is_cut_off: Bool[np.ndarray, "T N"]  # whether it can exchange no news with the observer
    looks: Looks | None = None  # at the channel; None in free space
    scene: Scene | None = None  # what changed the arena; files have its name only

    @property
    def frame(self) -> Frame:
        """The part of the ground that is shown: of an open area, only where robots ever are."""
        mission = self.facts.mission
        whole = frame(self.position_m, mission.half_side_m)
        if whole.moves or mission.has_walls:
            return whole
        low_m, high_m = (end(self.position_m, axis=(0, 1)) for end in (np.min, np.max))
        centre_m = np.tile((low_m + high_m) / 2.0, (len(self.window), 1))
        return Frame(centre_m=centre_m, reach_m=max(1.0, float(np.max(high_m - low_m)) / 2.0))

    def surprises(self, row: int) -> Surprises:
        """Links that surprise in one window, counted from 0."""
        return NO_SURPRISES if self.looks is None else self.looks.at(int(self.window[row]))

    def shortfalls(self, row: int) -> tuple[Int16[np.ndarray, "K"], Int16[np.ndarray, "K"]]:
        """Robots whose links with the observer are too weak, and their margins, below 0 [dB]."""
        links, own = self.surprises(row).by_kind["too_weak"], self.facts.observer
        links = links.chosen((links.sender == own) | (links.receiver == own))
        return np.where(links.sender == own, links.receiver, links.sender), links.margin_db

    def colours(self, full_scale: float | None = None) -> UInt8[np.ndarray, "T N 3"]:
        """The robots' colours, by the replay's own scale of ages unless one is given [windows]."""
        scale = self.facts.full_scale if full_scale is None else full_scale
        is_known, age = ~np.isnan(self.age), np.nan_to_num(self.age)
        return palette.robot_colours(age, scale, is_known, self.is_on, self.facts.observer)


def facts_of(log: Log, mission: Mission, policy: str, seed: int, own: Components) -> Facts:
    """What does not change in a mission that was recorded."""
    return Facts(
        mission=mission,
        policy=policy,
        seed=seed,
        observer=log.ego,
        is_broadcast=log.is_broadcast,
        full_scale=palette.nice_scale(log.age),
        **own.names,
    )


def footage_of(
    log: Log, mission: Mission, policy: str, seed: int, own: Components = Components()
) -> Footage:
    """What a video shows of a mission that was recorded.

    Args:
        log: What was flown.
        mission: Its numbers.
        policy: Its name, for the title.
        seed: The mission's.
        own: The user's own components.
    """
    return Footage(
        facts=facts_of(log, mission, policy, seed, own),
        window=log.window,
        position_m=log.position_m,
        velocity_mps=log.velocity_mps,
        age=log.known_age,
        is_on=log.is_on,
        shots=shots(fates(log), log.position_m),
        age_mean=log.age_mean,
        is_cut_off=log.is_cut_off,
        looks=log.looks,
        scene=log.scene,
    )
