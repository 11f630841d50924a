"""Options that several commands share: those that make missions, and those of policies."""

import shlex
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import Field, dataclass, fields, replace
from functools import partial
from itertools import product
from typing import Any

from swarm_mj.cli import OPTIONS
from swarm_mj.cli.options import flags_of, nested, nested_option
from swarm_mj.mission import PRESETS, WORLDS, Mission, make_mission, paper
from swarm_mj.mission.presets import NEEDED
from swarm_mj.policies.registry import PAYLOADS, POLICIES, WITHOUT_PAYLOAD
from swarm_mj.simulation.components import GROUP, SHOWN_AS, Components
from swarm_mj.system.fields import FieldOf, as_typed, kind_of, setting

HELP = OPTIONS["policies"]
NAMED = ", ".join(name for name in POLICIES if name != WITHOUT_PAYLOAD)  # `--payload` makes it
NAMES = f"who talks when (`swarm-mj policies` says more): {NAMED}"
OTHERS = "directories or .safetensors files of learned policies, or module:Name of your own"
_policy = partial(setting, group="policies")
TUNED = "tuned for the regime"
# What most people set: `--help` shows these, and `--help-all` the others, too.
COMMON = ("preset", "task", "num_robots", "range_ratio", "num_windows", "arena")
SPECS = [spec for spec in fields(Mission) if "help" in spec.metadata]
FLAGS = {spec.name: flags_of(spec)[0] for spec in SPECS}
USUAL = paper("flocking"), paper("stationary")  # whose defaults are shown


@dataclass(frozen=True, kw_only=True)
class PolicyOptions(Components):
    """Options that change a policy, or what it flies in."""

    probability: float | None = _policy(None, HELP["probability"], low=0.0, high=1.0, shown=TUNED)
    is_deterministic: bool = _policy(False, HELP["deterministic"])
    payload: str = _policy("snapshots", HELP["payload"], choices=PAYLOADS)
    features: tuple[str, ...] = setting((), HELP["features"], group=GROUP, metavar=SHOWN_AS)

    @property
    def components(self) -> Components:
        """The channel, controller and scene, by name."""
        return Components(**self.given)

    @property
    def how(self) -> dict[str, Any]:
        """Arguments of `make_policy` and `Study`, but for the policy's name and the mission."""
        names = ("probability", "is_deterministic", "features")
        return {name: getattr(self, name) for name in names}


def one_mission() -> FieldOf:
    """Return a field that is a mission."""
    return nested(_mission_options, lambda given: missions_of(given)[0])


def several_missions() -> FieldOf:
    """Return a field that is missions: options take several values, and those multiply."""
    return nested(partial(_mission_options, is_many=True), missions_of)


def missions_of(
    given: dict[str, Any], called: Callable[[str], str] = FLAGS.__getitem__
) -> tuple[Mission, ...]:
    """Return the missions of fields given, as `mission.NAME`; a tuple of values is swept."""
    swept: dict[str, Iterable[Any]] = {}
    for spec in fields(Mission):
        place = f"mission.{spec.name}"
        if place in given:
            value = given[place]
            swept[spec.name] = dict.fromkeys(value) if isinstance(value, tuple) else [value]
    missions = [make_mission(**dict(zip(swept, x, strict=True))) for x in product(*swept.values())]
    check_in_use(swept, missions, called)
    # A fraction that rounds to no robot makes the missions of 0, which are flown once.
    made = (m if m.num_high_power else replace(m, high_power_fraction=0.0) for m in missions)
    return tuple(dict.fromkeys(made))


def check_in_use(
    given: Collection[str], missions: Sequence[Mission], called: Callable[[str], str]
) -> None:
    """Raise ValueError for a field given that counts in no mission: another must switch it on."""
    for name, (switch, value) in NEEDED.items():
        states = [getattr(mission, switch) for mission in missions]
        is_on = (value in s.split(",") if value else s > 0.0 for s in states)
        if name in given and not any(is_on):
            shown = value or "above 0"
            ways = f"give that too, or leave {called(name)} out"
            raise ValueError(f"{called(name)} counts only with {called(switch)} {shown}; {ways}")


def mission_flags(mission: Mission) -> str:
    """Return the options that make a mission, without defaults except for the task."""
    usual = replace(PRESETS[mission.preset](mission.task), preset=Mission().preset)
    named = {spec: getattr(mission, spec.name) for spec in SPECS}
    return " ".join(
        flags_of(spec)[0] + ("" if value is True else f" {shlex.quote(as_typed(value))}")
        for spec, value in named.items()
        if spec.name == "task" or value != getattr(usual, spec.name)
    )


def _mission_options(*, is_many: bool = False) -> Iterator[Field[Any]]:
    heading = "missions: each takes several values; those multiply" if is_many else "mission"
    for spec in SPECS:
        about = {"group": heading, **spec.metadata, "shown": _default_of(spec), "is_many": is_many}
        about["is_common"] = spec.name in COMMON
        yield nested_option(spec, f"mission.{spec.name}", **about)


def _default_of(spec: Field[Any]) -> str:
    """Return a mission's default; where it depends on the task, the flock's and the others'."""
    flocks, others = (as_typed(getattr(mission, spec.name)) for mission in USUAL)
    if spec.name == "task":
        return f"{flocks}; {PRESETS[next(iter(WORLDS))]().task} under {', '.join(WORLDS)}"
    if flocks == others:
        return flocks if kind_of(spec) is not bool else ""
    return f"{others}; {flocks} for flocks, as in the paper"
