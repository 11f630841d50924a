"""Options that several commands share: those that make missions, and those of policies."""

import math
import shlex
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, fields, replace
from functools import partial
from itertools import product
from typing import Any

from swarm_mj.cli.options import Given, Option, flags_of, nested
from swarm_mj.evaluation.study import MAX_REGIMES
from swarm_mj.mission import PRESETS, WORLDS, Mission, make_mission, paper
from swarm_mj.mission.presets import DEPENDENT, usual_of
from swarm_mj.physics.arenas import ARENAS
from swarm_mj.policies.policy_arguments import PolicyArguments
from swarm_mj.policies.registry import PAYLOADS, POLICIES, WITHOUT_PAYLOAD
from swarm_mj.simulation.components import OWN_PARTS, SHOWN_AS, Components
from swarm_mj.system.fields import Meaning, as_typed, kind_of, meaning_of, setting
from swarm_mj.system.user_code import files_named

NAMED = ", ".join(name for name in POLICIES if name != WITHOUT_PAYLOAD)  # `--payload` makes it
NAMES = f"which robots transmit in each window (`swarm-mj policies` says more): {NAMED}"
OTHERS = "directories or .safetensors files of learned policies, or module:Name of your own"
SPECS = [spec for spec in fields(Mission) if meaning_of(spec).help]
FLAGS = {spec.name: flags_of(spec)[0] for spec in SPECS}
# Missions whose defaults are shown: of flocks, and of other tasks.
USUAL_FLOCK = paper("flocking")
USUAL_OTHER = paper("stationary")


@dataclass(frozen=True, kw_only=True)
class PolicyOptions(Components):
    """Options that change a policy, or what it flies in."""

    probability: float | None = setting(
        None,
        "transmission probability of random policies",
        low=0.0,
        high=1.0,
        shown="tuned for the regime",
        group="policies",
    )
    is_deterministic: bool = setting(
        False,
        "learned policies take the most probable recipient, not a draw",
        group="policies",
    )
    payload: str = setting(
        "snapshots",
        "what the planner's packets carry beyond T, M and P; in stationary teams, links",
        choices=PAYLOADS,
        group="policies",
    )
    features: tuple[str, ...] = setting(
        (),
        "own features of a trained policy (its file holds only the name)",
        group=OWN_PARTS,
        metavar=SHOWN_AS,
        reads=files_named,
    )
    networks: tuple[str, ...] = setting(
        (),
        "that a learned policy decides by, if it is someone's own; give it again",
        flag="--network",
        group=OWN_PARTS,
        metavar=SHOWN_AS,
        reads=files_named,
    )

    @property
    def components(self) -> Components:
        """The user's own parts, by name."""
        return Components(**self.given)

    @property
    def arguments(self) -> PolicyArguments:
        """The arguments that change the policy."""
        return PolicyArguments(
            probability=self.probability,
            is_deterministic=self.is_deterministic,
            features=self.features,
            networks=self.networks,
        )


def missions_given(
    given: Given, called: Callable[[str], str] = FLAGS.__getitem__
) -> tuple[Mission, ...]:
    """Return the missions of fields given, as `mission.NAME`; a tuple of values is swept."""
    swept: dict[str, list[Any]] = {}
    for spec in fields(Mission):
        place = f"mission.{spec.name}"
        if place in given:
            value = given[place]
            swept[spec.name] = list(dict.fromkeys(value)) if isinstance(value, tuple) else [value]
    missions = combined(swept)
    check_in_use(swept, missions, called)
    for index, mission in enumerate(missions):
        if mission.num_high_power == 0:
            # A fraction that rounds to no robot makes the missions of 0, which are flown once.
            missions[index] = replace(mission, high_power_fraction=0.0)
    return tuple(dict.fromkeys(missions))


def combined(swept: Mapping[str, Collection[Any]]) -> list[Mission]:
    """Return a mission for each combination of fields' values; ValueError for too many of them."""
    _check_number(swept)
    missions: list[Mission] = []
    for values in product(*swept.values()):
        named = dict(zip(swept, values, strict=True))
        missions.append(make_mission(**named))
    return missions


def _check_number(swept: Mapping[str, Collection[Any]]) -> None:
    """Raise ValueError for more missions than are made in a while: lists of values multiply."""
    number = math.prod(map(len, swept.values()))
    if number > MAX_REGIMES:
        factors: list[str] = []
        for name, values in swept.items():
            if len(values) > 1:
                factors.append(f"{len(values)} of {name}")
        raise ValueError(
            f"the values given multiply to {number} missions ({' x '.join(factors)}), and up to "
            f"{MAX_REGIMES} are allowed; give fewer values, or fly them one study after another"
        )


def mission_given(given: Given) -> Mission:
    """Return the one mission of fields given, as `mission.NAME`."""
    (mission,) = missions_given(given)
    return mission


def check_in_use(
    given: Collection[str], missions: Sequence[Mission], called: Callable[[str], str]
) -> None:
    """Raise ValueError for a field given that counts in no mission: another must switch it on."""
    for spec in fields(Mission):
        switch = meaning_of(spec).counts_with
        if switch is None or spec.name not in given:
            continue
        if not any(switch.is_on(mission) for mission in missions):
            own = called(spec.name)
            other = called(switch.name)
            ways = f"give that too, or leave {own} out"
            raise ValueError(f"{own} counts only with {other} {switch.needed}; {ways}")


def mission_flags(*missions: Mission) -> str:
    """Return the options that make missions, without defaults except for the task."""
    usual = [_usual_values(each) for each in missions]
    flags: list[str] = []
    for spec in SPECS:
        pairs = zip(missions, usual, strict=True)
        if spec.name != "task" and all(_can_be_left_out(spec, *pair) for pair in pairs):
            continue
        values = values_of(spec.name, missions)
        flags.append(flags_of(spec)[0])
        if values[0] is not True:  # else it is a flag
            flags += [shlex.quote(as_typed(value)) for value in values]
    return " ".join(flags)


def _usual_values(mission: Mission) -> dict[str, Any]:
    """Return the defaults of a mission's fields; together they need not be a mission."""
    dependent = usual_of(mission)
    usual = vars(PRESETS[mission.preset](mission.task)) | {"preset": Mission().preset}
    return usual | {name: getattr(dependent, name) for name in DEPENDENT}


def _can_be_left_out(spec: Field[Any], mission: Mission, usual: Mapping[str, Any]) -> bool:
    """Return whether a mission has a field's default, or the field does not count in it."""
    switch = meaning_of(spec).counts_with
    if switch is not None and not switch.is_on(mission):
        return True  # as one of several missions it may have another value, which alone is refused
    return getattr(mission, spec.name) == usual[spec.name]


def values_of(name: str, missions: Sequence[Mission]) -> tuple[Any, ...]:
    """Return a field's values in missions, each once, in order."""
    return tuple(dict.fromkeys(getattr(mission, name) for mission in missions))


def about_option(spec: Field[Any]) -> Meaning:
    """Return what the help says of a field of `Mission`: what it says itself, and what is there."""
    about = meaning_of(spec)
    if spec.name == "arena":  # the mission's room comes before the one that knows the arenas
        return replace(about, help=f"{about.help}: {', '.join(ARENAS)}, or an MJCF file")
    return about


def mission_options(*, is_many: bool = False, is_task_bare: bool = False) -> Iterator[Option]:
    """Yield the options of a mission.

    Those of several missions take several values. A bare task stands without its flag.
    """
    heading = "missions: each takes several values; those multiply" if is_many else "mission"
    for spec in SPECS:
        about = about_option(spec)
        about = replace(about, group=about.group or heading, shown=_default_of(spec))
        if spec.name == "task" and is_task_bare:
            about = replace(about, group="", is_positional=True, metavar="TASK")
        yield Option(spec, about, f"mission.{spec.name}", is_many=is_many, is_nested=True)


# Fields of a command's dataclass: a mission, and missions whose options take several values, which
# multiply.
one_mission = partial(nested, mission_options, mission_given)
several_missions = partial(nested, partial(mission_options, is_many=True), missions_given)


def _default_of(spec: Field[Any]) -> str:
    """Return a mission's default; the boundary's depends on the task and the arena."""
    flocks = as_typed(getattr(USUAL_FLOCK, spec.name))
    others = as_typed(getattr(USUAL_OTHER, spec.name))
    if spec.name == "task":
        return f"{flocks}; {PRESETS[next(iter(WORLDS))]().task} under {', '.join(WORLDS)}"
    if flocks == others:
        return flocks if kind_of(spec) is not bool else ""
    return f"{flocks} for flocks in open areas, else {others}"
