"""Missions whose numbers go together: the paper's text, its authors' code, and whole worlds."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from swarm_mj.mission.specification import OPEN, Mission, Task

_NUMBERS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
NEEDED = {  # the effect that a number counts with; a state of it, if only that
    number: (effect, state or None) for number, (effect, state) in _NUMBERS["needed"].items()
}


def paper(task: Task = "flocking", **overrides: Any) -> Mission:
    """Return the paper's text, taken literally, with any fields of `Mission` overridden.

    Unless overridden, a flock has no boundary. In an arena with obstacles it has one, and physics
    are `contact`, as where robots collide. Raises as `Mission` does.
    """
    is_open = overrides.get("arena", OPEN) == OPEN
    is_touching = not is_open or overrides.get("collide", False)
    usual = Mission(
        task=task,
        # The paper's flocks fly off freely; obstacles only make sense where robots stay.
        boundary="none" if task == "flocking" and is_open else "reflect",
        physics="contact" if is_touching else "exact",
    )
    return replace(usual, **overrides)


def reference(task: Task = "flocking", **overrides: Any) -> Mission:
    """Return the setting of the authors' published code and numbers; arguments as of `paper`."""
    code = _NUMBERS["reference"] | {"tree_recomputed": task != "stationary"}
    return paper(task, **(code | overrides))


def world(preset: str, task: Task = "random-walk", **overrides: Any) -> Mission:
    """Return a mission in an arena of `WORLDS`, with its channel; arguments as of `paper`."""
    return paper(task, **({"preset": preset} | WORLDS[preset] | overrides))


WORLDS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("worlds.toml").read_text(encoding="utf-8")
)
PAPERS: dict[str, Callable[..., Mission]] = {"paper": paper, "reference": reference}
PRESETS = PAPERS | {name: partial(world, name) for name in WORLDS}


def make_mission(**given: Any) -> Mission:
    """Return a mission of the preset and task given, or the defaults, with the other fields."""
    preset = given.pop("preset", Mission().preset)
    # Refuses an unknown preset or task by the field's own message, before it is looked up.
    replace(Mission(), preset=preset, task=given.get("task", Mission().task))
    return PRESETS[preset](**given)
