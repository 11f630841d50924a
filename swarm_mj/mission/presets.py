"""Missions whose numbers go together: the paper's text, its authors' code, and whole worlds."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from swarm_mj.mission.specification import NOTHING, OPEN, Mission, Task
from swarm_mj.system.fields import as_typed

_NUMBERS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
OFF = ("free-space", "none", 0)  # of the channel's effects
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


def beyond_free_space(mission: Mission) -> str:
    """Return the channel's differences from the paper's, in words; empty for free space."""
    named: list[str] = []
    for effect in _NUMBERS["effects"]:
        # A fraction that rounds to no robot is no effect.
        name = "num_high_power" if effect == "high_power_fraction" else effect
        if (state := getattr(mission, name)) not in OFF:
            counting = ((effect, None), (effect, state))
            named += [name, *(number for number in NEEDED if NEEDED[number] in counting)]
    return ", ".join(f"{name} {as_typed(getattr(mission, name))}" for name in named)


def radio_in_words(mission: Mission) -> str:
    """Return what differs from the paper's radio and positions, in words; empty if nothing does."""
    usual = Mission()
    other = [name for name in _NUMBERS["other"] if getattr(mission, name) != getattr(usual, name)]
    words = [f"{name} {as_typed(getattr(mission, name))}" for name in other]
    return ", ".join(filter(None, (beyond_free_space(mission), *words)))


def bits_per_second(rate: float) -> str:
    """Return a bit rate in words, by the usual prefix."""
    for prefix, unit in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if rate >= unit:
            return f"{rate / unit:.4g} {prefix}bit/s"
    return f"{rate:.4g} bit/s"


def where_flown(mission: Mission) -> list[str]:
    """Return arena, channel, prior knowledge and bit rate in words; a world by its preset."""
    is_world, radio = mission.preset in WORLDS, radio_in_words(mission)
    usual = PRESETS[mission.preset]() if is_world else Mission()
    where = [f"preset {mission.preset}"] if is_world else []
    if mission.arena != usual.arena:
        where.append(f"arena {mission.arena}")
    if radio != radio_in_words(usual):
        where.append(radio or "free space")
    if mission.prior_knowledge != NOTHING:
        where.append(f"prior knowledge {mission.prior_knowledge}")
    if mission.bit_rate is not None:
        where.append(bits_per_second(mission.bit_rate))
    return where


def make_mission(**given: Any) -> Mission:
    """Return a mission of the preset and task given, or the defaults, with the other fields."""
    preset = given.pop("preset", Mission().preset)
    # Refuses an unknown preset or task by the field's own message, before it is looked up.
    replace(Mission(), preset=preset, task=given.get("task", Mission().task))
    return PRESETS[preset](**given)
