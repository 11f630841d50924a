"""`swarm-mj study`: flies a study that is a file, or compares two results."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args, get_origin

from swarm_mj.cli.evaluate import StudyFlags, run_study
from swarm_mj.cli.mission_options import OTHERS, missions_given
from swarm_mj.cli.options import Given
from swarm_mj.evaluation.study import DEFAULT_POLICIES, MAX_REGIMES, Study
from swarm_mj.mission import Mission
from swarm_mj.policies import registry
from swarm_mj.protocol.mission_costs import AOI, TASK_COST
from swarm_mj.simulation.components import TABLE, Components
from swarm_mj.system.arguments import check_kind, check_names, did_you_mean
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import former_names, setting
from swarm_mj.system.interrupt import raise_if_interrupted
from swarm_mj.system.packages import asset, need
from swarm_mj.system.reading import read_file
from swarm_mj.system.streams import check_printable
from swarm_mj.system.terminal import plain_console

MAX_BYTES = 1_000_000
# A flock's velocity variance is its task's cost; that of other tasks, no policy can change.
COMPARED = (AOI, TASK_COST)
StudyAction = Literal["run", "compare"]
TAKES: dict[StudyAction, str] = {"run": "FILE.toml", "compare": "BEFORE.parquet AFTER.parquet"}


@dataclass(frozen=True, kw_only=True)
class StudyOptions(StudyFlags):
    """The options of `swarm-mj study`."""

    EPILOG: ClassVar = (
        "FILE.toml has tables of fields: [study] (policies, episodes, seed, baseline), [mission] "
        "(of Mission in Python; of several values, each is flown) and [missions.NAME], which adds "
        f"missions of its own. {StudyFlags.EPILOG}"
    )
    action: StudyAction = setting(
        help="what to do", metavar="ACTION", choices=get_args(StudyAction), is_positional=True
    )
    named: tuple[str, ...] = setting(
        help="a study to run, FILE.toml or a shipped one's name; or two results to compare, each "
        "written by --parquet",
        metavar="FILE",
        reads=lambda name: [Path(name)],
        is_positional=True,
    )
    policy: tuple[str, ...] = setting(
        (),
        f"fly these in place of the study's policies: names that `swarm-mj policies` prints, all "
        f"of them, {OTHERS}",
        metavar="NAME",
        shown="the study's",
        reads=registry.files_of,
    )
    trust: bool = setting(
        False, "run the code that the study names, as module:Name; look at it before"
    )


def run(options: StudyOptions) -> int:
    """Run the command; return its exit code."""
    action = options.action
    named = options.named
    if len(named) != len(TAKES[action].split()):
        raise ValueError(f"study {action} takes {TAKES[action]}, not {' '.join(named)}")
    if action == "run":
        study = read_study(*named, is_trusted=options.trust)
        return run_study(options, flown_by(study, options.policy) if options.policy else study)
    if options != StudyOptions(action=action, named=named):
        raise ValueError("study compare prints what it finds; leave out the options")
    need("scipy", "a comparison")
    from swarm_mj.evaluation.missions_table import compared, read_missions  # pandas is slow

    before = read_missions(Path(named[0]))
    after = read_missions(Path(named[1]))
    raise_if_interrupted()  # while pandas was loaded, which swallows it
    for cost in COMPARED:
        rows = compared(before, after, cost)
        if len(rows):  # tasks without a cost have none
            table = rows.to_string(index=False, na_rep="-", float_format="{:.3g}".format)
            title = f"{cost.column}, means over missions, with 95 % intervals"
            plain_console().print(f"{title}\n{table}\n")
    return DONE


def flown_by(study: Study, policies: Iterable[str]) -> Study:
    """Return a study of the same missions by other policies.

    They are compared with its baseline if that is among them, else with the first of them.
    """
    listed = tuple(registry.listed(policies))
    baseline = study.compared_to if study.compared_to in listed else None
    return replace(study, policies=listed, baseline=baseline)


def read_study(name: str, *, is_trusted: bool = False) -> Study:
    """Return the study of a TOML file, or a shipped one.

    Args:
        name: The file's path, or the name of a shipped study.
        is_trusted: Whether code that the file names, as `module:Name`, may be run. To make a study
            is to run it, and a file may come from anyone.

    Raises:
        ValueError: There is no such study, the file is none, or names code and is not trusted.
        OSError: The file cannot be read.
    """
    shipped = {each.stem: each for each in asset("studies").glob("*.toml")}
    path = shipped.get(name, Path(name))
    if path.suffix != ".toml":
        hint = did_you_mean(name, shipped) or f"; these are shipped: {', '.join(sorted(shipped))}"
        raise ValueError(f"a study must be named FILE.toml, not {name}{hint}")
    content = read_file(path, "study", MAX_BYTES)
    try:
        return _study(tomllib.loads(content.decode()), is_trusted=is_trusted)
    except RecursionError as error:
        raise ValueError(f"study {path}: it is nested too deep") from error
    except (ValueError, TypeError) as error:
        raise ValueError(f"study {path}: {error}") from error


def _study(tables: dict[str, Any], *, is_trusted: bool) -> Study:
    """Return a study from a file's tables; without [missions.NAME], [mission] has its missions."""
    _check_texts(tables)
    check_names("a study", tables, ("study", "mission", "missions"))
    own = _values("[study]", tables.get("study", {}), Study)
    policies = own.get("policies", DEFAULT_POLICIES)
    check_kind("policies", policies, tuple, '["tdma", "mst"]')
    for policy in policies:
        check_kind("each policy", policy, str, '"tdma"')
    own["policies"] = tuple(registry.listed(policies))
    parts = _values("[study.components]", own.get("components", {}), Components)
    for kind, part in parts.items():
        check_kind(f"[study.components] {kind}", part, str, '"my_parts:Mine"')
    own["components"] = Components(**parts)
    if not is_trusted:
        _check_names_no_code(own)
    shared = _values("[mission]", tables.get("mission", {}), Mission)
    regimes: list[Mission] = []
    named = tables.get("missions", {"": {}})
    check_kind("[missions]", named, dict, "tables, [missions.NAME]")
    for name, table in named.items():
        place = f"[missions.{name}]" if name else "[mission]"
        given = shared | _values(place, table, Mission)
        placed = {f"mission.{field}": value for field, value in given.items()}
        try:
            regimes += missions_given(placed, called=str)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from error
        if len(regimes) > MAX_REGIMES:  # tables may be many, too: stop before all are read
            raise ValueError(
                f"the tables have more than {MAX_REGIMES} missions, the most allowed; fly them in "
                "several studies"
            )
    return Study(**own, regimes=tuple(dict.fromkeys(regimes)))


def _check_texts(value: object) -> None:
    """Raise ValueError for a text in a file that would drive the terminal that shows it."""
    if isinstance(value, str):
        check_printable(value, "write it without them")
    elif isinstance(value, dict):
        for name, each in value.items():
            _check_texts(name)
            _check_texts(each)
    elif isinstance(value, list):
        for each in value:
            _check_texts(each)


def _check_names_no_code(own: Given) -> None:
    """Raise ValueError if a file's table [study] names users' code, which making it would run."""
    named = [name for name in own["policies"] if registry.is_own_policy(name)]
    named += [str(name) for name in (*own.get("features", ()), *own.get("networks", ()))]
    for name in own["components"].names.values():
        if not name.startswith(TABLE):
            named.append(name)
    if named:
        raise ValueError(
            f"it runs someone's own {named[0]:.200}; if you trust that code, give --trust"
        )


def _values(place: str, given: Given, kind: type[Any]) -> Given:
    """Return a table's values by the names of a dataclass's fields; lists are tuples.

    A field of several values may be given as a single text.
    """
    check_kind(place, given, dict, "num_robots = 20")
    types = {spec.name: spec.type for spec in fields(kind)}
    check_names(place, given, types, former_names(kind))
    values: Given = {}
    for name, value in given.items():
        takes_many = get_origin(types[name]) is tuple
        if takes_many and isinstance(value, str):  # one policy, say, in place of a list of one
            values[name] = (value,)
        elif isinstance(value, list):
            values[name] = tuple(value)
        else:
            values[name] = value
    return values
