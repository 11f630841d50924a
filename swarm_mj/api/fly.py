"""`swarm_mj.fly`: one mission from Python."""

import inspect
import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Unpack

from swarm_mj.api.flight import Flight, flight_needs, fly_mission
from swarm_mj.api.live import LiveFlight, viewer_to_keep
from swarm_mj.api.run import Run
from swarm_mj.control.motion import Controller
from swarm_mj.mission import Mission, PresetAndFields, make_mission
from swarm_mj.physics.robots import OwnPilot
from swarm_mj.physics.scene import Scene
from swarm_mj.policies import registry
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.policy_arguments import PolicyArguments
from swarm_mj.radio.free_space import OwnChannel
from swarm_mj.simulation.components import Components
from swarm_mj.system.arguments import check_kind, check_names
from swarm_mj.system.fields import former_names
from swarm_mj.system.needs import check_fits
from swarm_mj.system.terminal import quiet_console


def fly(
    task: str | Mission | None = None,
    *,
    policy: str | Path | Policy = "planner",
    seed: int = 1,
    probability: float | None = None,
    is_deterministic: bool = False,
    record: bool = True,
    observer: int = 0,
    live: bool | str = False,
    speed: float | None = None,
    channel: OwnChannel | None = None,
    controller: str | Controller | None = None,
    scene: str | Scene | None = None,
    pilot: OwnPilot | None = None,
    features: str | Sequence[str] = (),
    networks: str | Sequence[str] = (),
    **mission_fields: Unpack[PresetAndFields],
) -> Run:
    """Fly one mission, from the first window to the last.

    The same arguments give the same numbers as `swarm-mj fly` does. On a terminal, a bar shows how
    far it is. Ctrl-C ends the flight after a whole window and keeps what was flown; so does a lack
    of memory. Both warn.

    Args:
        task: The robots' task by name, or a `Mission`. None is "flocking", and "random-walk" in the
            presets "indoor", "urban" and "open-field".
        policy: Who transmits when: a name of `POLICIES`, the folder of a learned one, an object, or
            `module:Name` of your own.
        seed: The same seed is the same mission.
        probability: The transmission probability of random policies; tuned unless given.
        is_deterministic: Whether a learned policy takes its most probable recipient, not a draw.
        record: Whether to keep the data of replays and videos, which takes memory.
        observer: The robot whose knowledge the replay shows, from 0.
        live: True shows the mission in rerun's viewer while it flies, "web" in a browser, at the
            address that is printed. The viewer stays open until Python ends.
        speed: Of a live flight, by the mission's own time: 1 is real time, None as fast as it goes.
        channel: Who decodes whom, as an object or `module:Name`; the mission's radio unless given.
        controller: What drives the robots, likewise; that of the task unless given.
        scene: A function that edits the MuJoCo model, likewise; none unless given.
        pilot: What makes the controls of robots with bodies, likewise; the robot's unless given.
        features: Names of your own feature extractors that a learned policy was trained with.
        networks: Names of your own networks that it decides by.
        **mission_fields: Any field of `Mission`, in its unit, such as `num_robots=20` or
            `preset="reference"`.

    Returns:
        The run: its numbers by name in `summary`, each window's in `windows`, a chart, and the
        replay or the video that `save` writes.

    Raises:
        ValueError: A value is unknown or out of range, or memory does not suffice.
        TypeError: An argument is of the wrong kind, or unknown.
        KeyboardInterrupt: Ctrl-C before the first window.

    Example:
        ```python
        import swarm_mj

        run = swarm_mj.fly("random-walk", policy="tdma", num_robots=10, num_windows=100, seed=7)
        print(run.summary.aoi_mean)  # the age of information, mean over windows [windows]
        run.save("flight.csv")
        ```
    """
    mission = mission_of(fly, task, mission_fields)
    named = names_of(features)
    arguments = PolicyArguments(
        probability=probability,
        is_deterministic=is_deterministic,
        features=named,
        networks=names_of(networks),
    )
    _check_shown(live, speed, record=record)
    made, name = _policy_of(policy, mission, arguments)
    way_out = "choose fewer num_robots or num_windows"
    if record:
        way_out += ", or record=False"
    needed = flight_needs(mission, name, is_recorded=record)
    check_fits(needed, None, way_out, is_forced=False, way_on="")
    flight = Flight(
        mission=mission,
        policy=made,
        policy_name=name,
        arguments=arguments,
        components=Components(channel=channel, controller=controller, scene=scene, pilot=pilot),
        seed=seed,
        observer=observer,
        is_recorded=record,
        speed=math.inf if speed is None else speed,
    )
    console = quiet_console()
    shows = None
    if live:
        viewer = viewer_to_keep(live, console)
        shows = LiveFlight(viewer, f"{name}, seed {seed}", speed=speed).begin
    flown = fly_mission(flight, console=console, way_on="", shows=shows)
    if flown.ending:
        warnings.warn(f"{flown.ending}; these are kept", stacklevel=2)
    return flown.recorded


def _check_shown(live: bool | str, speed: float | None, *, record: bool) -> None:
    """Raise ValueError for arguments of live flights that do not go together."""
    if live and not record:
        raise ValueError("live shows what is recorded; leave out record=False")
    if speed is not None and not live:
        raise ValueError(f"speed={speed:g} is of live flights; add live=True")
    if speed is not None and not speed > 0.0:
        raise ValueError(f"speed must be above 0, not {speed:g}; None is as fast as it goes")


def mission_of(
    function: Callable[..., object], task: str | Mission | None, mission_fields: PresetAndFields
) -> Mission:
    """Return the mission that a function's arguments name; TypeError for fields it cannot have."""
    parameters = inspect.signature(function).parameters.values()
    known = [spec.name for spec in fields(Mission)]
    known.remove("task")  # which is given by position
    known += [each.name for each in parameters if each.kind is each.KEYWORD_ONLY]
    check_names(f"swarm_mj.{function.__name__}", mission_fields, known, former_names(Mission))
    if isinstance(task, Mission) and mission_fields:
        given = ", ".join(f"{name}={value!r}" for name, value in mission_fields.items())
        rule = f"you gave a finished mission, so {', '.join(mission_fields)} must be part of it"
        raise TypeError(f"{rule}: dataclasses.replace(mission, {given})")
    return make_mission(task, **mission_fields)


def names_of(given: str | Iterable[str]) -> tuple[str, ...]:
    """Return the names as a tuple; a text by itself is one name."""
    return (given,) if isinstance(given, str) else tuple(given)


def _policy_of(
    policy: str | Path | Policy, mission: Mission, arguments: PolicyArguments
) -> tuple[Policy, str]:
    """Return a policy and its name: what was given, or its class's."""
    if isinstance(policy, Policy):
        if arguments.probability is not None or arguments.is_deterministic:
            raise TypeError(
                "probability and is_deterministic change policies by name; make it with them"
            )
        return policy, type(policy).__name__
    check_kind("policy", policy, (str, Path), '"planner"')
    name = registry.flown_name(str(policy), mission)
    return registry.make_policy_with(arguments, name, mission), name
