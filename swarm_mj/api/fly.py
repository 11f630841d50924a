"""`swarm_mj.fly`: one mission from Python, flown as `swarm-mj fly` flies it."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from swarm_mj.api.bars import quiet_bar
from swarm_mj.api.estimates import flight_needs
from swarm_mj.api.flight import (
    COMPILING_WINDOWS,
    compile_ahead,
    flight_config,
    flight_summary,
    fly_swarm,
)
from swarm_mj.api.numbers import Numbers
from swarm_mj.api.run import Run
from swarm_mj.control.controller import Controller
from swarm_mj.mission import Mission, make_mission
from swarm_mj.mission.components import CALLED_WITH, Components
from swarm_mj.physics.scene import Scene
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import check_used, flown_name, make_policy, normalised
from swarm_mj.radio.free_space import Channel
from swarm_mj.replay.recorder import Recorder
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import check_kind, check_names
from swarm_mj.system.needs import check_fits

MISSION_FIELDS = tuple(spec.name for spec in fields(Mission) if spec.name != "task")
SHARED = ("seed", "probability", "is_deterministic", "features", *CALLED_WITH)  # with `evaluate`
KEYWORDS = ("policy", "record", "observer", *SHARED)


def fly(
    task: str | Mission | None = None,
    *,
    policy: str | Path | Policy = "planner",
    seed: int = 1,
    probability: float | None = None,
    is_deterministic: bool = False,
    record: bool = True,
    observer: int = 0,
    channel: str | Channel | None = None,
    controller: str | Controller | None = None,
    scene: str | Scene | None = None,
    features: str | Sequence[str] = (),
    **mission_fields: Any,
) -> Run:
    """Flies one mission, from the first window to the last.

    The same arguments give the same numbers as `swarm-mj fly` does. On a terminal, a bar shows how
    far it is. Ctrl-C ends the flight after a whole window and keeps what was flown.

    Args:
        task: What the robots do, by name; or a mission of one's own. None is "flocking", and
            "random-walk" in the presets "indoor", "urban" and "open-field".
        policy: Who transmits when: a name of `POLICIES`, the folder of a learned one, an object, or
            `module:Name` of your own.
        seed: The same seed is the same mission.
        probability: Of a transmission, for the named policies that have one; tuned unless given.
        is_deterministic: Whether a learned policy takes its most probable recipient, not a draw.
        record: Whether to keep what a replay and a video show; without it less memory is needed.
        observer: The robot whose knowledge the replay shows.
        channel: Who decodes whom, as an object or `module:Name`; the mission's radio unless given.
        controller: What drives the robots, likewise; that of the task unless given.
        scene: What changes the arena, likewise; nothing unless given.
        features: Names of your own feature extractors, that learned policies may see by.
        **mission_fields: Any field of `Mission`, such as `num_robots=20` or `preset="reference"`.

    Returns:
        What was flown.

    Raises:
        ValueError: A value is unknown or out of range, or memory does not suffice.
        TypeError: An argument is of the wrong kind, or has a name that is not known.
        KeyboardInterrupt: Ctrl-C was pressed before the first window was flown.
    """
    mission = mission_of("swarm_mj.fly", task, mission_fields, KEYWORDS)
    how: dict[str, Any] = {"probability": probability, "is_deterministic": is_deterministic}
    how["features"] = names_of(features)
    chosen, name = _policy_of(policy, mission, how)
    check_used(how["features"], [chosen])
    components = Components(channel=channel, controller=controller, scene=scene)
    needs, way_out = flight_needs(mission, name, is_recorded=record), "choose fewer num_robots or "
    way_out += "num_windows" + (", or record=False" if record else "")
    check_fits(needs, None, way_out, is_forced=False, way_on="")
    swarm = Swarm(mission, [seed], **components.given)
    is_broadcast = chosen.window(mission).is_broadcast
    recorder = Recorder(swarm, ego=observer, is_broadcast=is_broadcast) if record else None
    with quiet_bar("Compiling", COMPILING_WINDOWS, "windows") as compiling:
        like = "tdma" if isinstance(policy, Policy) else name  # objects are flown but once
        compile_ahead(mission, like, compiling.advance, **how)
    bar = quiet_bar("Flying", mission.num_windows, "windows")
    flown = fly_swarm(swarm, chosen, recorder, bar, way_on="")
    if flown.code != DONE:
        kept = f"{len(flown.windows)} of {mission.num_windows} windows; these are kept"
        warnings.warn(f"{flown.ending} after {kept}", stacklevel=2)
    return Run(
        mission=mission,
        config=flight_config(mission, name, chosen, seed=seed, observer=observer)
        | components.names,
        summary=Numbers(flight_summary(mission, chosen, flown)),
        windows=tuple(flown.windows),
        log=recorder.log() if recorder else None,
    )


def names_of(features: str | Sequence[str]) -> tuple[str, ...]:
    """Names of feature extractors, one or several."""
    return (features,) if isinstance(features, str) else tuple(features)


def mission_of(
    function: str,
    task: str | Mission | None,
    mission_fields: Mapping[str, Any],
    known: tuple[str, ...],
) -> Mission:
    """Return the mission that a function's arguments name.

    Args:
        function: Its name, for messages.
        task: What the robots do, by name; or the mission itself. None is as usual.
        mission_fields: Other fields of the mission.
        known: The function's other arguments, any of which may have been meant.

    Raises:
        ValueError: A value is unknown or out of range.
        TypeError: A field is none, nor among the other names that are `known`.
    """
    check_names(function, mission_fields, (*MISSION_FIELDS, *known))
    if not isinstance(task, Mission):
        return make_mission(**({} if task is None else {"task": task}), **mission_fields)
    if mission_fields:
        fields_given = ", ".join(f"{name}={value!r}" for name, value in mission_fields.items())
        raise TypeError(
            f"you gave a finished mission, so {', '.join(mission_fields)} must be part of it: "
            f"dataclasses.replace(mission, {fields_given})"
        )
    return task


def _policy_of(
    policy: str | Path | Policy, mission: Mission, how: Mapping[str, Any]
) -> tuple[Policy, str]:
    """Return a policy and its name: what was given, or its class's."""
    if not isinstance(policy, Policy):
        check_kind("policy", policy, (str, Path), '"planner"')
        name = flown_name(normalised(str(policy)), mission)
        return make_policy(name, mission, **how), name
    if how["probability"] is not None or how["is_deterministic"]:
        raise TypeError(
            "probability and is_deterministic change policies by name; make it with them"
        )
    return policy, type(policy).__name__
