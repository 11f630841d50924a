"""Missions whose numbers go together: the paper's text, its authors' code, and whole worlds.

Where the paper's text and its authors' code differ, each difference is a field of `Mission`:
`paper()` follows the text, `reference()` the code.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from swarm_mj.mission.specification import OPEN, Boundary, Mission, PhysicsMode, Task


def paper(task: Task = "flocking", **overrides: Any) -> Mission:
    """Return the paper's text, taken literally.

    Args:
        task: What the robots do; a flock has no boundary unless `overrides` give it one.
        **overrides: Any field of `Mission`. In an arena with obstacles physics are `contact` and
            flocks have a boundary, unless they say otherwise; where robots collide, physics are
            `contact`, too.

    Returns:
        The mission.

    Raises:
        ValueError: A value is outside its range.
        TypeError: An override is no field of `Mission`.
    """
    is_open = overrides.get("arena", OPEN) == OPEN
    boundary: Boundary = "none" if task == "flocking" and is_open else "reflect"
    is_touching = not is_open or overrides.get("collide", False)
    physics: PhysicsMode = "contact" if is_touching else "exact"
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


def world(preset: str, task: Task = "random-walk", **overrides: Any) -> Mission:
    """Return a mission of the paper's text in an arena, with the channel that goes with it.

    Args:
        preset: One of `WORLDS`.
        task: What the robots do. They walk unless told otherwise, as robots at rest lose nobody.
        **overrides: Any field of `Mission`.

    Returns:
        The mission.

    Raises:
        ValueError: A value is outside its range.
        TypeError: An override is no field of `Mission`.
    """
    return paper(task, **({"preset": preset} | WORLDS[preset] | overrides))


# Where obstacles stand they make what is not in line of sight, so the channels are those of lines
# of sight: means of 3GPP TR 38.901 v16, Tables 7.4.1-1 (slopes, shadowing) and 7.5-6 (correlation
# distances, K in dB: 9 of UMi, 7 of InH and RMa).
WORLDS: dict[str, dict[str, Any]] = {
    # Free space between light walls is the multi-wall model (COST 231 1999, section 4.7).
    "indoor": {
        "arena": "rooms",
        "shadowing_db": 3.0,  # InH, office
        "shadowing_distance_m": 10.0,
        "fading": "rician",
        "rician_k": 5.0,  # 7 dB
    },
    # UMi, street canyon: 32.4 + 21 log10(d) + 20 log10(f) is free space up to 1 m. A block of 25 dB
    # then is its loss without line of sight: 23 dB more at 200 m.
    "urban": {
        "arena": "blocks",
        "path_loss": "log-distance",
        "loss_exponent": 2.1,
        "reference_m": 1.0,
        "shadowing_db": 4.0,
        "shadowing_distance_m": 10.0,
        "fading": "rician",
        "rician_k": 8.0,  # 9 dB
    },
    # Two-ray ground (Rappaport 2002), antennas as high as 3GPP's users carry theirs; K of RMa.
    "open-field": {
        "path_loss": "two-ray",
        "antenna_height_m": 1.5,
        "fading": "rician",
        "rician_k": 5.0,  # 7 dB
    },
}
PAPERS: dict[str, Callable[..., Mission]] = {"paper": paper, "reference": reference}
PRESETS = PAPERS | {name: partial(world, name) for name in WORLDS}


def where_flown(mission: Mission) -> list[str]:
    """Where it was flown: a world's arena and channel by the preset, all others by themselves."""
    arena, radio = f"arena {mission.arena}", mission.beyond_free_space
    if mission.preset not in WORLDS:
        return [*([arena] if mission.arena != OPEN else []), *([radio] if radio else [])]
    usual, changed = PRESETS[mission.preset](), []
    if mission.arena != usual.arena:
        changed.append(arena)
    if radio != usual.beyond_free_space:
        changed.append(radio or "free space")
    return [f"preset {mission.preset}", *changed]


def make_mission(**given: Any) -> Mission:
    """A mission of the preset and task that are given, or usual, changed by the other fields."""
    preset = given.pop("preset", Mission().preset)
    replace(Mission(), preset=preset, task=given.get("task", Mission().task))  # refuses the unknown
    return PRESETS[preset](**given)
