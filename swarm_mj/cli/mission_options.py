"""The options that make missions: those fields of `Mission` that have a help."""

import argparse
from dataclasses import Field, fields, replace
from functools import partial
from itertools import product
from typing import Any, get_args

from swarm_mj.cli.options import add_option, as_typed, flag_of, nested
from swarm_mj.mission import PRESETS, Mission, Task, paper

SPECS = [spec for spec in fields(Mission) if "help" in spec.metadata]


def one_mission() -> Any:  # noqa: ANN401 - a dataclass field takes the type of its attribute
    """A field that is a mission."""
    return nested(_add, lambda given: missions_of(given)[0])


def several_missions() -> Any:  # noqa: ANN401 - as above
    """A field that is missions: options take several values, and those multiply."""
    return nested(partial(_add, is_many=True), missions_of)


def missions_of(given: dict[str, Any]) -> tuple[Mission, ...]:
    """The missions that options name.

    Args:
        given: The options, by `mission.` and the field's name; a list sweeps.

    Returns:
        All combinations, the last field's values varying fastest.

    Raises:
        ValueError: A value is unknown or outside its range.
    """
    swept = {
        name: given[f"mission.{name}"] for spec in SPECS if _is_given(name := spec.name, given)
    }
    values = [list(dict.fromkeys(v)) if isinstance(v, list) else [v] for v in swept.values()]
    return tuple(_mission(**dict(zip(swept, each, strict=True))) for each in product(*values))


def default_of(spec: Field[Any], preset: str = "paper") -> str:
    """A mission's own value; where it depends on the task, the flock's beside the others'."""
    own = {task: as_typed(getattr(PRESETS[preset](task), spec.name)) for task in get_args(Task)}
    flocks, others = own["flocking"], own["stationary"]
    if spec.name == "task":
        return paper().task
    return others if flocks == others else f"{others}; {flocks} for flocks, as in the paper"


def mission_flags(mission: Mission) -> str:
    """The options that make a mission; those that are as usual are left out, but for the task."""
    usual = replace(PRESETS[mission.preset](mission.task), preset=Mission().preset)
    named = {spec: getattr(mission, spec.name) for spec in SPECS}
    return " ".join(
        f"{flag_of(spec)} {as_typed(value)}"
        for spec, value in named.items()
        if spec.name == "task" or value != getattr(usual, spec.name)
    )


def _is_given(name: str, given: dict[str, Any]) -> bool:
    return f"mission.{name}" in given


def _mission(**given: Any) -> Mission:  # noqa: ANN401 - fields of a mission
    preset, task = (given.pop(name, getattr(Mission(), name)) for name in ("preset", "task"))
    replace(Mission(), preset=preset, task=task)  # refuses what is unknown
    return PRESETS[preset](task, **given)


def _add(parser: argparse.ArgumentParser, *, is_many: bool = False) -> None:
    about = "Each takes several values; those multiply." if is_many else None
    group = parser.add_argument_group("missions" if is_many else "mission", about)
    for spec in SPECS:
        add_option(group, spec, f"mission.{spec.name}", default_of(spec), is_many=is_many)
