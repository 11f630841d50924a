"""The options of a training run: fields of its settings, by their dotted place in them.

Unless given, each is the usual one of the credit assignment, or in a resumed run the run's own.
"""

import argparse
from dataclasses import Field, fields
from functools import reduce
from typing import Any, get_origin

from swarm_mj.cli.options import add_option, as_typed, flag_of
from swarm_mj.gnn.shape import GnnShape
from swarm_mj.learning.settings import PpoSettings, Training, usual_settings
from swarm_mj.mission import PRESETS, Mission

PARTS = {"": Training, "network.": GnnShape, "ppo.": PpoSettings, "mission.": Mission}
HEADINGS = {"": "run", "network.": "network", "ppo.": "PPO", "mission.": "missions"}
NOT_TRAINED = ("num_robots", "physics", "switched_off")  # team sizes are the run's own
SPECS: dict[str, Field[Any]] = {
    f"{part}{spec.name}": spec
    for part, owner in PARTS.items()
    for spec in fields(owner)
    if "help" in spec.metadata and not (owner is Mission and spec.name in NOT_TRAINED)
}


def add_setting_options(parser: argparse.ArgumentParser) -> None:
    """Declares them, under a heading for each part of the settings."""
    groups = {part: parser.add_argument_group(title) for part, title in HEADINGS.items()}
    for place, spec in SPECS.items():
        add_option(groups[place.removesuffix(spec.name)], spec, place, _usual(place))


def given_settings(given: dict[str, Any]) -> dict[str, Any]:
    """The settings that were given, by their places."""
    return {
        place: tuple(dict.fromkeys(given[place]))
        if get_origin(spec.type) is tuple
        else given[place]
        for place, spec in SPECS.items()
        if place in given
    }


def stored_value(settings: object, place: str) -> object:
    """A value by its place in a run's settings."""
    return reduce(getattr, place.split("."), settings)


def typed(place: str, value: object) -> str:
    """A setting as it is typed: its flag and its value."""
    return f"{flag_of(SPECS[place])} {as_typed(value)}"


def _usual(place: str) -> str:
    """The default as text: per robot and, where it differs, per team."""
    if place == "arm":
        return "robot"
    robot, team = (_usual_of(arm, place) for arm in ("robot", "team"))
    if robot == "False":
        return ""
    return robot if robot == team else f"{robot}, team: {team}"


def _usual_of(arm: str, place: str) -> str:
    """The default as text, if it does not depend on preset or task."""
    missions = (PRESETS["paper"]("stationary"), PRESETS["reference"]("flocking"))
    usual, other = (
        stored_value(usual_settings(arm, each, (each.num_robots,)), place) for each in missions
    )
    depends = usual != other and place not in ("mission.preset", "mission.task")
    return "the preset's own" if depends else as_typed(usual)
