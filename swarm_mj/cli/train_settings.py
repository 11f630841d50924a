"""From the options of `swarm-mj train` to a run's settings.

The options are fields of the settings, by their dotted place in them. Unless given, each is the
usual one of the credit assignment, or in a resumed run the run's own.
"""

from collections.abc import Iterator
from dataclasses import Field, fields, replace
from operator import attrgetter
from pathlib import Path
from typing import Any

from swarm_mj.cli.mission_options import FLAGS, about_option, check_in_use
from swarm_mj.cli.options import Option, flags_of
from swarm_mj.learning.settings import PpoSettings, Training, usual_settings
from swarm_mj.mission import PRESETS, Mission, make_mission
from swarm_mj.policies.gnn.feature_sets import check_named, is_own_set, load_features, num_features
from swarm_mj.policies.policy_config import GnnConfig, GnnShape
from swarm_mj.protocol.packets import check_whole
from swarm_mj.simulation.components import GROUP, Components
from swarm_mj.system.fields import about_of, as_typed
from swarm_mj.system.user_code import is_own

PARTS = {  # the dataclasses of settings and their headings in the help, by their dotted place
    "": (Training, "run"),
    "network.": (GnnShape, "network"),
    "ppo.": (PpoSettings, "PPO"),
    "components.": (Components, GROUP),
    "mission.": (Mission, "missions"),
}


def _specs() -> dict[str, Field[Any]]:
    """Return the fields that are options, by their dotted place."""
    specs: dict[str, Field[Any]] = {}
    for part, (owner, _) in PARTS.items():
        for spec in fields(owner):
            is_size = spec.name == "num_robots"  # team sizes are the run's own
            if about_of(spec).help and not is_size:
                specs[f"{part}{spec.name}"] = spec
    return specs


SPECS = _specs()


def setting_options() -> Iterator[Option]:
    """Yield the settings as options, under a heading for each part of the settings."""
    for place, spec in SPECS.items():
        _, heading = PARTS[place.removesuffix(spec.name)]
        about = about_option(spec) if place.startswith("mission.") else about_of(spec)
        about = replace(about, group=heading, shown=_usual(place))
        yield Option(spec, about, place, is_nested=True)


def given_settings(given: dict[str, Any]) -> dict[str, Any]:
    """Return the settings that were given, by their places; a value of several counts once."""
    values = {place: given[place] for place in SPECS if place in given}
    return {at: tuple(dict.fromkeys(x)) if isinstance(x, tuple) else x for at, x in values.items()}


def asked_settings(
    given: dict[str, Any], init: GnnConfig | None = None, init_path: Path | None = None
) -> Training:
    """Return the settings of a new run: the usual ones of its credit, changed by those given.

    `init` is the policy that the run begins with. Raise ValueError for what cannot be trained.
    """
    own, network, asked = (_part(part, given) for part in ("", "network", "mission"))
    sizes = own.get("robots", (Mission().num_robots,))
    mission = make_mission(**{"task": "stationary", "num_robots": sizes[0]} | asked)
    check_in_use(asked, [mission], FLAGS.__getitem__)
    training = usual_settings(own.get("credit_assignment", "robot"), mission, sizes)
    if init is not None:
        same = {name: getattr(init, name) for name in ("network", "features", "silence_logit")}
        training = replace(training, **same)
        shape = {at: x for at, x in given.items() if at.startswith(("features", "network"))}
        refuse_others(shape, training, f"the policy {init_path}")
        check_named(init.features, own_names(given), f"policy {init_path}")
    missions = _missions(own.get("missions"), training.missions, len(sizes))
    components = Components(**_part("components", given))
    training = replace(training, missions=missions, components=components)
    load_own(own.get("features", training.features), training)
    if "features" in own:
        network["num_features"] = num_features(own["features"])
    training = replace(
        training,
        groups=_num_groups(missions, len(sizes)),
        network=replace(training.network, **network),
        ppo=replace(training.ppo, **_part("ppo", given)),
        **own,
    )
    for size in training.robots:
        check_whole("training", replace(mission, num_robots=size))
    if training.reward == "velocity-variance" and not mission.flocks:
        rule = "reward velocity-variance depends on who talks only if the robots flock"
        raise ValueError(f"{rule}; add --task flocking")
    return training


def own_names(given: dict[str, Any]) -> list[str]:
    """Return the names of custom components and features among settings that were given."""
    may_be = [x for place, x in given.items() if place.startswith(("features", "components."))]
    return [value for value in may_be if is_own(value)]


def load_own(features: str, training: Training) -> None:
    """Load a run's custom features and components; raise ValueError if one cannot be made."""
    if is_own_set(features):
        load_features(features)
    training.components.made(training.mission)


def refuse_others(given: dict[str, Any], training: Training, whose: str) -> None:
    """Raise ValueError if a setting contradicts a run, or the policy that it begins with."""
    for place, value in given.items():
        stored = attrgetter(place)(training)
        if value != stored:
            typed = f"{flags_of(SPECS[place])[0]} {as_typed(value)}"
            raise ValueError(f"{typed} is not what {whose} has, {as_typed(stored)}; leave it out")


def _part(part: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return the settings given of one part, by their names in it."""
    parted = ((place.rpartition("."), value) for place, value in given.items())
    return {name: value for (owner, _, name), value in parted if owner == part}


def _missions(asked: int | None, usual: int, num_sizes: int) -> int:
    """Return the number of missions side by side: as many of every team size."""
    if asked is None:
        return -(-usual // num_sizes) * num_sizes
    if asked % num_sizes:
        raise ValueError(f"missions must be a multiple of the {num_sizes} team sizes, not {asked}")
    return asked


def _num_groups(missions: int, num_sizes: int) -> int:
    """Return a number near to the usual one of groups, each with as many of every team size."""
    able = [n for n in range(num_sizes, missions + 1, num_sizes) if missions % n == 0]
    return min(able, key=lambda n: (abs(n - Training.groups), -n), default=1)


def _usual(place: str) -> str:
    """Return the default as text: per robot and, where it differs, per team."""
    own = about_of(SPECS[place]).shown
    if own is not None:
        return own
    shown: list[str] = []
    value_of = attrgetter(place)
    for credit in ("robot", "team"):
        missions = (PRESETS["paper"]("stationary"), PRESETS["reference"]("flocking"))
        usual, other = (value_of(usual_settings(credit, each, (40,))) for each in missions)
        depends = usual != other and place not in ("mission.preset", "mission.task")
        shown.append("the preset's own" if depends else as_typed(usual))
    robot, team = shown
    if robot == "False":
        return ""
    return robot if place == "credit_assignment" or robot == team else f"{robot}, team: {team}"
