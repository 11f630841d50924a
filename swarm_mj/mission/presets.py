"""Missions whose numbers go together: the paper's text, its authors' code, and whole worlds.

Where the paper's text and its authors' code differ, each difference is a field of `Mission`:
`paper()` follows the text, `reference()` the code.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from swarm_mj.mission.specification import OPEN, Boundary, Mission, PhysicsMode, Task


def paper(task: Task = "flocking", **overrides: Any) -> Mission:
    """The paper's text, taken literally.

    Args:
        task: What the robots do; a flock has no boundary unless `overrides` give it one.
        **overrides: Any field of `Mission`. In an arena with obstacles physics are `contact` and
            flocks have a boundary, unless they say otherwise.

    Returns:
        The mission.

    Raises:
        ValueError: A value is outside its range.
        TypeError: An override is no field of `Mission`.
    """
    is_open = overrides.get("arena", OPEN) == OPEN
    boundary: Boundary = "none" if task == "flocking" and is_open else "reflect"
    physics: PhysicsMode = "exact" if is_open else "contact"
    usual = Mission(task=task, boundary=boundary, physics=physics)
    return replace(usual, **overrides)


def reference(task: Task = "flocking", **overrides: Any) -> Mission:
    """What the authors' published code does; the setting of the published numbers.

    Args:
        task: What the robots do; a flock has no boundary unless `overrides` give it one.
        **overrides: Any field of `Mission`.

    Returns:
        The mission.

    Raises:
        ValueError: A value is outside its range.
        TypeError: An override is no field of `Mission`.
    """
    code: dict[str, Any] = {
        "preset": "reference",
        "max_acceleration_mps2": 10.0,
        "wall_hit": "clip",
        "half_duplex": "eavesdroppers",
        "flocking_set": "moving",
        "silence_is_attempt": True,
        "moves_each_transmission": True,
        "tree_recomputed": task != "stationary",
        "tree_root_transmits": True,
    }
    return paper(task, **(code | overrides))


PRESETS: dict[str, Callable[..., Mission]] = {"paper": paper, "reference": reference}
