"""Missions whose numbers go together: the paper's text, its authors' code, and whole worlds."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Unpack

from swarm_mj.mission.bodies import POINT
from swarm_mj.mission.keywords import MissionFields, TaskAndFields
from swarm_mj.mission.specification import Mission
from swarm_mj.mission.surroundings import OPEN
from swarm_mj.mission.team import Task
from swarm_mj.system.fields import check_value

# Fields whose defaults depend on others, as `usual_of` and every preset see to.
DEPENDENT = ("boundary", "physics")


def paper(task: Task = "flocking", **overrides: Unpack[MissionFields]) -> Mission:
    """Return the paper's text, taken literally.

    Unless overridden, a flock has no boundary. In an arena with obstacles it has one, and physics
    are `contact`, as where robots collide or have bodies.

    Args:
        task: What the robots do: "stationary", "random-walk" or "flocking".
        **overrides: Fields of `Mission`, which says their units and ranges.

    Returns:
        The mission.

    Raises:
        ValueError: A field is outside its range, or does not go with another.
        TypeError: A field is unknown.

    Example:
        >>> paper("stationary", num_robots=20, fading="rayleigh").range_m  # [m]
        250.0
    """
    return _overridden(Mission(task=task), overrides)


def reference(task: Task = "flocking", **overrides: Unpack[MissionFields]) -> Mission:
    """Return the setting of the authors' published code and numbers.

    Args:
        task: What the robots do, as of `paper`.
        **overrides: Fields of `Mission`, as of `paper`.

    Returns:
        The mission.

    Raises:
        ValueError: As of `paper`.
        TypeError: As of `paper`.

    Example:
        >>> reference("random-walk").max_acceleration_mps2  # the text has 20 [m/s²]
        10.0
    """
    code = Mission(
        preset="reference",
        task=task,
        max_acceleration_mps2=10.0,
        wall_hit="clip",
        half_duplex="eavesdroppers",
        flocking_set="moving",
        silence_is_attempt=True,
        moves_each_transmission=True,
        tree_recomputed=task != "stationary",
        tree_root_transmits=True,
    )
    return _overridden(code, overrides)


# Arenas with their channels. Where obstacles stand they make what is not in line of sight, so the
# channels are those of lines of sight: means of 3GPP TR 38.901 v16, Tables 7.4.1-1 (slopes,
# shadowing) and 7.5-6 (correlation distances, K in dB: 9 of UMi, 7 of InH and RMa).


def indoor(task: Task = "random-walk", **overrides: Unpack[MissionFields]) -> Mission:
    """Return a mission on an office floor.

    Free space between light walls is the multi-wall model (COST 231 1999, section 4.7).

    Args:
        task: What the robots do: "stationary", "random-walk" or "flocking".
        **overrides: Fields of `Mission`, which says their units and ranges.

    Returns:
        The mission.

    Raises:
        ValueError: A field is outside its range, or does not go with another.
        TypeError: A field is unknown.

    Example:
        >>> indoor("random-walk", num_robots=20).arena
        'rooms'
    """
    floor = Mission(
        preset="indoor",
        task=task,
        arena="rooms",
        physics="contact",
        shadowing_db=3.0,  # InH, office
        shadowing_distance_m=10.0,
        fading="rician",
        rician_k=5.0,  # 7 dB
    )
    return _overridden(floor, overrides)


def urban(task: Task = "random-walk", **overrides: Unpack[MissionFields]) -> Mission:
    """Return a mission in street canyons between blocks.

    UMi: 32.4 + 21 log10(d) + 20 log10(f) is free space up to 1 m. A block of 25 dB then is its
    loss without line of sight: 23 dB more at 200 m.

    Args:
        task: What the robots do: "stationary", "random-walk" or "flocking".
        **overrides: Fields of `Mission`, which says their units and ranges.

    Returns:
        The mission.

    Raises:
        ValueError: A field is outside its range, or does not go with another.
        TypeError: A field is unknown.

    Example:
        >>> urban("random-walk", num_robots=20).arena
        'blocks'
    """
    streets = Mission(
        preset="urban",
        task=task,
        arena="blocks",
        physics="contact",
        path_loss="log-distance",
        loss_exponent=2.1,
        reference_m=1.0,
        shadowing_db=4.0,
        shadowing_distance_m=10.0,
        fading="rician",
        rician_k=8.0,  # 9 dB
    )
    return _overridden(streets, overrides)


def open_field(task: Task = "random-walk", **overrides: Unpack[MissionFields]) -> Mission:
    """Return a mission on an open field.

    Two-ray ground (Rappaport 2002), antennas as high as 3GPP's users carry theirs; K of RMa.

    Args:
        task: What the robots do: "stationary", "random-walk" or "flocking".
        **overrides: Fields of `Mission`, which says their units and ranges.

    Returns:
        The mission.

    Raises:
        ValueError: A field is outside its range, or does not go with another.
        TypeError: A field is unknown.

    Example:
        >>> open_field("random-walk", num_robots=20).path_loss
        'two-ray'
    """
    field = Mission(
        preset="open-field",
        task=task,
        path_loss="two-ray",
        antenna_height_m=1.5,
        fading="rician",
        rician_k=5.0,  # 7 dB
    )
    return _overridden(field, overrides)


def usual_of(mission: Mission) -> Mission:
    """Return what a mission's preset makes for its task, size, arena and robots alone.

    Of the fields that have other defaults there, as the boundary has in an arena, it has those.

    Args:
        mission: Any.

    Returns:
        A mission of the same preset and task, with as many robots of that kind in that arena, which
        collide if they do; everything else is as usual.

    Example:
        >>> usual_of(paper("flocking", arena="forest", boundary="none")).boundary
        'reflect'
    """
    # The number is among them because kinds of robots have to add up to it.
    return PRESETS[mission.preset](
        mission.task,
        num_robots=mission.num_robots,
        arena=mission.arena,
        robot=mission.robot,
        collide=mission.collide,
    )


def _overridden(preset: Mission, overrides: MissionFields) -> Mission:
    """Return a preset's mission with other fields, and the walls and physics that go with them."""
    is_open = overrides.get("arena", preset.arena) == OPEN
    is_touching = not is_open or overrides.get("collide", preset.collide)
    has_bodies = overrides.get("robot", preset.robot) != POINT
    usual: MissionFields = {
        # The paper's flocks fly off freely; obstacles only make sense where robots stay.
        "boundary": "none" if preset.flocks and is_open else "reflect",
        "physics": "contact" if is_touching or has_bodies else "exact",
    }
    return replace(preset, **(usual | overrides))


PAPERS: dict[str, Callable[..., Mission]] = {"paper": paper, "reference": reference}
WORLDS: dict[str, Callable[..., Mission]] = {
    "indoor": indoor,
    "urban": urban,
    "open-field": open_field,
}
PRESETS = PAPERS | WORLDS


def make_mission(
    mission: Mission | str | None = None,
    /,
    *,
    preset: str | None = None,
    **given: Unpack[TaskAndFields],
) -> Mission:
    """Return the mission that arguments name, be they of Python, a file or a command line.

    Args:
        mission: A mission, to change fields of; or what the robots do, as the field `task`, too,
            may say. None is the preset's own task.
        preset: A name of `PRESETS`; None is "paper", or the preset of the mission given.
        **given: Other fields of `Mission`, which says their units and ranges.

    Returns:
        The mission of the preset, or the one given, with those fields.

    Raises:
        ValueError: A field is outside its range, or does not go with another; or a mission is
            given with another preset than its own.
        TypeError: A field is unknown, or the task is given twice.

    Example:
        >>> make_mission("flocking", preset="urban", num_robots=9).arena
        'blocks'
    """
    if isinstance(mission, Mission):
        if preset not in (None, mission.preset):
            raise ValueError(
                f"preset {preset} goes with a task's name, and this mission is given whole, from "
                f"the preset {mission.preset}; leave it out"
            )
        return replace(mission, **given) if given else mission
    named: dict[str, Any] = dict(given)  # a task may be any text until it is checked
    if mission is not None:
        if "task" in named:
            # In Python's words: `mission` is where it was given first.
            raise TypeError("a mission got multiple values for keyword argument 'task'")
        named["task"] = mission
    if preset is None:
        preset = Mission().preset
    # The fields' own messages refuse what is unknown, before it is looked up.
    specs = Mission.__dataclass_fields__
    check_value(specs["preset"], preset)
    if "task" in named:
        check_value(specs["task"], named["task"])
    return PRESETS[preset](**named)
