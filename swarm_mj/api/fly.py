"""`swarm_mj.fly`: one mission from Python, flown as `swarm-mj fly` flies it."""

import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from swarm_mj.api import flight
from swarm_mj.api.run import Run
from swarm_mj.control.motion import Controller
from swarm_mj.mission import Mission, make_mission
from swarm_mj.mission.components import Components
from swarm_mj.physics.scene import Scene
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import check_used, flown_name, make_policy, normalised
from swarm_mj.radio.free_space import Channel
from swarm_mj.replay.recorder import Recorder
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import check_kind, check_names
from swarm_mj.system.needs import check_fits
from swarm_mj.system.progress import quiet_bar


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
    """Fly one mission, from the first window to the last.

    The same arguments give the same numbers as `swarm-mj fly` does. On a terminal, a bar shows how
    far it is. Ctrl-C ends the flight after a whole window and keeps what was flown.

    Args:
        task: The robots' task by name, or a `Mission`. None is "flocking", and "random-walk" in the
            presets "indoor", "urban" and "open-field".
        policy: Who transmits when: a name of `POLICIES`, the folder of a learned one, an object, or
            `module:Name` of your own.
        seed: The same seed is the same mission.
        probability: Of a transmission, for the named policies that have one; tuned unless given.
        is_deterministic: Whether a learned policy takes its most probable recipient, not a draw.
        record: Whether to keep the data of replays and videos, which takes memory.
        observer: The robot whose knowledge the replay shows.
        channel: Who decodes whom, as an object or `module:Name`; the mission's radio unless given.
        controller: What drives the robots, likewise; that of the task unless given.
        scene: A function that adds obstacles to the arena, likewise; none unless given.
        features: Names of your own feature extractors that a learned policy was trained with.
        **mission_fields: Any field of `Mission`, such as `num_robots=20` or `preset="reference"`.

    Raises:
        ValueError: A value is unknown or out of range, or memory does not suffice.
        TypeError: An argument is of the wrong kind, or has a name that is not known.
        KeyboardInterrupt: Ctrl-C was pressed before the first window was flown.
    """
    mission = mission_of(fly, task, mission_fields)
    how = {"probability": probability, "is_deterministic": is_deterministic}
    how |= {"features": names_of(features)}
    chosen, name = _policy_of(policy, mission, how)
    check_used(how["features"], [chosen])
    components = Components(channel=channel, controller=controller, scene=scene)
    way_out = "choose fewer num_robots or num_windows" + (", or record=False" if record else "")
    needs = flight.flight_needs(mission, name, is_recorded=record)
    check_fits(needs, None, way_out, is_forced=False, way_on="")
    swarm = Swarm(mission, [seed], **components.given)
    swarm.start(chosen)
    recorder = Recorder(swarm, ego=observer) if record else None
    with quiet_bar("Compiling", flight.COMPILING_WINDOWS, "windows") as compiling:
        like = "tdma" if isinstance(policy, Policy) else name  # an object flies only once
        flight.compile_ahead(mission, like, compiling.advance, **how)
    bar = quiet_bar("Flying", mission.num_windows, "windows")
    flown = flight.fly_swarm(swarm, recorder, bar, way_on="")
    if flown.code != DONE:
        kept = f"{len(flown.windows)} of {mission.num_windows} windows; these are kept"
        warnings.warn(f"{flown.ending} after {kept}", stacklevel=2)
    run = flight.run_of(
        swarm, flown, name=name, seed=seed, observer=observer, components=components
    )
    return replace(run, log=recorder.log()) if recorder else run


def names_of(features: str | Sequence[str]) -> tuple[str, ...]:
    """Return names of feature extractors, one or several."""
    return (features,) if isinstance(features, str) else tuple(features)


def mission_of(
    function: Callable[..., Any], task: str | Mission | None, mission_fields: Mapping[str, Any]
) -> Mission:
    """Return the mission that a function's arguments name: a task's, or a finished one.

    A field that is unknown may have been meant for any keyword of the function.

    Raises:
        ValueError: A value is unknown or out of range.
        TypeError: A field is none of a mission's, or the mission is complete already.
    """
    parameters = inspect.signature(function).parameters.values()
    keywords = [each.name for each in parameters if each.kind is each.KEYWORD_ONLY]
    names = [spec.name for spec in fields(Mission) if spec.name != "task"]
    check_names(f"swarm_mj.{function.__name__}", mission_fields, [*names, *keywords])
    if not isinstance(task, Mission):
        return make_mission(**({} if task is None else {"task": task}), **mission_fields)
    if mission_fields:
        given = ", ".join(f"{name}={value!r}" for name, value in mission_fields.items())
        raise TypeError(
            f"you gave a finished mission, so {', '.join(mission_fields)} must be part of it: "
            f"dataclasses.replace(mission, {given})"
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
