"""The team in words: what titles say of the robots, their height and the wind."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarm_mj.mission.bodies import POINT, can_fly
from swarm_mj.mission.specification import Mission

# What is said of robots with bodies, in this order, unless it is as usual: the numbers' fields.
OF_BODIES = {
    "height_range_m": "to {:g} m higher",
    "wind_mps": "wind {:g} m/s",
    "gust_mps": "gusts {:g} m/s",
    "gust_s": "over {:g} s",
    "robot_spread": "spread {:g}",
}


def bodies_in_words(robot: str, numbers: Mapping[str, Any]) -> list[str]:
    """Return how high robots fly, the wind and how they differ; nothing of points.

    Args:
        robot: Their kind, as the field of `Mission`.
        numbers: Fields of `Mission`, by name; those that an older file lacks are not said.
    """
    words: list[str] = []
    if robot == POINT:
        return words
    usual = Mission()
    height_m = numbers.get("height_m")
    if height_m is not None and can_fly(robot):
        words.append(f"at {height_m:g} m")
    for name, form in OF_BODIES.items():
        value = numbers.get(name)
        if value is not None and value != getattr(usual, name):
            words.append(form.format(value))
    return words


def robots_in_words(mission: Mission) -> str:
    """Return how many robots of which kind there are, such as "30 quadrotors and 10 rovers"."""
    if not mission.has_bodies:
        return f"{mission.num_robots} robots"
    kinds = [_counted(group.kind, group.num_robots) for group in mission.groups]
    *others, last = kinds
    return f"{', '.join(others)} and {last}" if others else last


def _counted(kind: str, number: int) -> str:
    """Return a number of robots of a kind, which may be a file."""
    name = Path(kind).stem
    if name != kind:
        return f"{number} robots of {kind}"
    return f"1 {kind}" if number == 1 else f"{number} {kind}s"
