"""`swarm-mj study`: flies a study that is a file, or compares two results."""

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, get_origin

from swarm_mj.cli import EPILOGS, OPTIONS
from swarm_mj.cli.evaluate import StudyFlags, run_study
from swarm_mj.cli.mission_options import missions_of
from swarm_mj.evaluation.study import DEFAULT_POLICIES, Study
from swarm_mj.mission import Mission
from swarm_mj.policies import registry
from swarm_mj.simulation.components import Components
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import check_kind, check_names, did_you_mean, setting
from swarm_mj.system.packages import asset, need
from swarm_mj.system.reading import read_file
from swarm_mj.system.terminal import plain_console

MAX_BYTES = 1_000_000
TAKES = {"run": "FILE.toml", "compare": "BEFORE.parquet AFTER.parquet"}


@dataclass(frozen=True, kw_only=True)
class StudyOptions(StudyFlags):
    """The options of `swarm-mj study`."""

    EPILOG: ClassVar = f"{EPILOGS['study']} {StudyFlags.EPILOG}"
    action: str = setting(
        help="what to do", metavar="ACTION", choices=tuple(TAKES), is_positional=True
    )
    named: tuple[str, ...] = setting(
        help=OPTIONS["study"]["named"], metavar="FILE", is_positional=True
    )


def run(options: StudyOptions) -> int:
    """Run the command; return its exit code."""
    action = options.action
    named = options.named
    if len(named) != len(TAKES[action].split()):
        raise ValueError(f"study {action} takes {TAKES[action]}, not {' '.join(named)}")
    if action == "run":
        return run_study(options, read_study(*named))
    if options != StudyOptions(action=action, named=named):
        raise ValueError("study compare prints what it finds; leave out the options")
    need("scipy", "a comparison")
    from swarm_mj.evaluation.missions_table import compared, read_missions  # pandas is slow

    before, after = (read_missions(Path(name)) for name in named)
    for cost in ("aoi", "task_cost"):
        rows = compared(before, after, cost)
        if len(rows):  # tasks without a cost have none
            table = rows.to_string(index=False, na_rep="-", float_format="{:.3g}".format)
            plain_console().print(f"{cost}, means over missions, with 95 % intervals\n{table}\n")
    return DONE


def read_study(name: str) -> Study:
    """Return the study of a TOML file, or a shipped one by its name; ValueError for a bad one."""
    shipped = {each.stem: each for each in asset("studies").glob("*.toml")}
    path = shipped.get(name, Path(name))
    if path.suffix != ".toml":
        hint = did_you_mean(name, shipped) or f"; these are shipped: {', '.join(sorted(shipped))}"
        raise ValueError(f"a study must be named FILE.toml, not {name}{hint}")
    content = read_file(path, "study", MAX_BYTES)
    try:
        return _study(tomllib.loads(content.decode()))
    except (ValueError, TypeError) as error:
        raise ValueError(f"study {path}: {error}") from error


def _study(tables: dict[str, Any]) -> Study:
    check_names("a study", tables, ("study", "mission", "missions"))
    own = _values("[study]", tables.get("study", {}), Study)
    own["policies"] = tuple(registry.listed(own.get("policies", DEFAULT_POLICIES)))
    own["components"] = Components(**own.get("components", {}))
    shared = _values("[mission]", tables.get("mission", {}), Mission)
    regimes: list[Mission] = []
    for name, table in tables.get("missions", {"": {}}).items():
        place = f"[missions.{name}]" if name else "[mission]"
        given = shared | _values(place, table, Mission)
        try:
            regimes += missions_of({f"mission.{each}": x for each, x in given.items()}, str)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from error
    return Study(**own, regimes=tuple(dict.fromkeys(regimes)))


def _values(place: str, given: dict[str, Any], kind: type[Any]) -> dict[str, Any]:
    """Return a table's values by the names of a dataclass's fields; lists are tuples.

    A field of several values may be given as a single text.
    """
    check_kind(place, given, dict, "num_robots = 20")
    has_several = {spec.name: get_origin(spec.type) is tuple for spec in fields(kind)}
    check_names(place, given, has_several)
    values: dict[str, Any] = {}
    for name, value in given.items():
        if isinstance(value, list):
            values[name] = tuple(value)
        elif isinstance(value, str) and has_several[name]:
            values[name] = (value,)
        else:
            values[name] = value
    return values
