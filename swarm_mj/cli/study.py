"""`swarm-mj study`: flies a study that is a file."""

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, get_origin

from swarm_mj.cli.evaluate import StudyFlags, fly
from swarm_mj.cli.mission_options import missions_of
from swarm_mj.evaluation.study import DEFAULT_POLICIES, Study
from swarm_mj.mission import Mission
from swarm_mj.mission.components import Components
from swarm_mj.policies import registry
from swarm_mj.system.fields import check_kind, check_names, did_you_mean, setting
from swarm_mj.system.packages import asset
from swarm_mj.system.reading import read_file

MAX_BYTES = 1_000_000


@dataclass(frozen=True, kw_only=True)
class StudyOptions(StudyFlags):
    """The options of `swarm-mj study`."""

    EPILOG: ClassVar = (
        "FILE.toml has tables of fields: [study] (policies, episodes, seed, baseline), [mission] "
        "(of Mission in Python; of several values, each is flown) and [missions.NAME], which adds "
        f"missions of its own. {StudyFlags.EPILOG}"
    )
    action: str = setting(help="fly it", choices=("run",), is_positional=True)
    file: str = setting(
        help="FILE.toml, or the name of a study that is shipped", metavar="FILE", is_positional=True
    )


def run(options: StudyOptions) -> int:
    """Run the command; return its exit code."""
    return fly(options, read_study(options.file))


def read_study(name: str) -> Study:
    """Return the study of a TOML file, or of one that is shipped, by its name.

    Raises ValueError for a file that cannot be read, an unknown key, and as `Study` and `Mission`.
    """
    shipped = {each.stem: each for each in asset("studies").glob("*.toml")}
    path = shipped.get(name, Path(name))
    if path.suffix != ".toml":
        hint = did_you_mean(name, shipped) or f"; these are shipped: {', '.join(sorted(shipped))}"
        raise ValueError(f"a study must be named FILE.toml, not {name}{hint}")
    try:
        return _study(tomllib.loads(read_file(path, "study", MAX_BYTES).decode()))
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
    """Return a table's values by the names of a dataclass's fields; lists are tuples."""
    check_kind(place, given, dict, "num_robots = 20")
    known = {spec.name: get_origin(spec.type) is tuple for spec in fields(kind)}
    check_names(place, given, known)
    given |= {name: [given[name]] for name in given if known[name] and isinstance(given[name], str)}
    return {name: tuple(x) if isinstance(x, list) else x for name, x in given.items()}
