"""Plans flown on paper: what a scorer's schedules lead to when beliefs are somewhat wrong.

No physics and no radio windows: a team stands still, its schedules follow from positions that are
believed with an error, and their packets travel over the true links. That is what a planner meets
between two epochs, at a hundredth of the cost of a mission.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from swarm_mj.buffers import NEVER
from swarm_mj.channel import radio_of
from swarm_mj.mission import Mission, paper
from swarm_mj.placement import connected_positions
from swarm_mj.policies.broadcasts import fly, schedule
from swarm_mj.policies.greedy import HALVES, Links
from swarm_mj.policies.plan import NO_FORESIGHT
from swarm_mj.policies.planner import regular_length
from swarm_mj.policies.schedule import links_between
from swarm_mj.policies.worth import Scorer

NUM_EPOCHS = 3  # the first brings the team from nothing to its steady state, and does not count


@dataclass(frozen=True, kw_only=True)
class Exercise:
    """A kind of team to practise with."""

    mission: Mission
    num_teams: int
    largest_error_m: float = 0.0  # standard deviation of what is believed, per axis [m]
    lacks_robot: bool = False  # whether the schedules do not know of one


@dataclass(frozen=True, kw_only=True)
class Team:
    """One team, standing still."""

    exercise: str
    links: Links  # as they are
    believed: tuple[Links, ...]  # as they seem in each epoch
    epoch_windows: int


EXERCISES: dict[str, Exercise] = {
    "sparse": Exercise(mission=paper("stationary", range_ratio=0.2), num_teams=2),
    "usual": Exercise(mission=paper("stationary"), num_teams=4),
    "dense": Exercise(mission=paper("stationary", range_ratio=0.5), num_teams=2),
    "denser": Exercise(mission=paper("stationary", range_ratio=0.75), num_teams=1),
    "all linked": Exercise(mission=paper("stationary", range_ratio=1.0), num_teams=1),
    "lacking": Exercise(mission=paper("stationary"), num_teams=1, lacks_robot=True),
    "10 walk": Exercise(
        mission=paper("random-walk", num_robots=10), num_teams=6, largest_error_m=6.0
    ),
    "20 walk": Exercise(
        mission=paper("random-walk", num_robots=20), num_teams=3, largest_error_m=6.0
    ),
    "40 walk": Exercise(mission=paper("random-walk"), num_teams=3, largest_error_m=6.0),
    "80 walk": Exercise(
        mission=paper("random-walk", num_robots=80), num_teams=1, largest_error_m=6.0
    ),
}


def draw_teams(exercises: Mapping[str, Exercise], rng: np.random.Generator) -> list[Team]:
    """Teams for every exercise.

    Args:
        exercises: By name.
        rng: Draws positions, errors and who is lacking.

    Returns:
        The teams; equal generators draw equal ones.
    """
    return [
        _draw_team(name, exercise, rng)
        for name, exercise in exercises.items()
        for _ in range(exercise.num_teams)
    ]


def mean_age(team: Team, scorer: Scorer) -> float:
    """The mean age of information when a team flies by a scorer's schedules [windows].

    The schedules go on from the timestamps that they themselves expected, as a planner's do, and
    do not look ahead.
    """
    num_robots = len(team.links.received_mw)
    expected = np.full((num_robots, num_robots), NEVER, dtype=np.float32)
    true = expected.copy()
    num_halves = HALVES * team.epoch_windows
    ages = []
    for epoch, believed in enumerate(team.believed):
        now = float(epoch * num_halves)
        speaks = np.zeros((num_halves, num_robots), dtype=bool)
        is_free = np.ones(num_halves, dtype=bool)
        schedule(expected, now, believed, scorer(believed), NO_FORESIGHT, is_free, speaks)
        ages.append(fly(true, now, team.links, speaks))
    return float(np.mean(ages[1:])) / HALVES


def _draw_team(name: str, exercise: Exercise, rng: np.random.Generator) -> Team:
    mission = exercise.mission
    num_robots, radio = mission.num_robots, radio_of(mission)
    position_m = connected_positions(num_robots, mission.half_side_m, mission.range_m, rng)
    spread_m = np.full(num_robots, rng.uniform(0.0, exercise.largest_error_m))
    is_known = np.ones(num_robots, dtype=bool)
    is_known[rng.integers(num_robots)] = not exercise.lacks_robot
    believed = tuple(
        links_between(radio, _with_error(position_m, spread_m, rng), _doubted(spread_m), is_known)
        for _ in range(NUM_EPOCHS)
    )
    return Team(
        exercise=name,
        links=links_between(radio, position_m),
        believed=believed,
        epoch_windows=regular_length(num_robots),
    )


def _with_error(
    position_m: Float[np.ndarray, "N 2"], spread_m: Float[np.ndarray, "N"], rng: np.random.Generator
) -> Float[np.ndarray, "N 2"]:
    return position_m + spread_m[:, None] * rng.standard_normal(position_m.shape)


def _doubted(spread_m: Float[np.ndarray, "N"]) -> Float[np.ndarray, "N"] | None:
    """Nothing where positions are known."""
    return spread_m if np.any(spread_m > 0.0) else None
