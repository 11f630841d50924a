"""From the options of `swarm-mj train` to a run's settings.

The options are fields of the settings, by their dotted place in them. Unless given, each is the
usual one of the credit assignment, or in a resumed run the run's own.
"""

from collections.abc import Iterator
from dataclasses import Field, fields, replace
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any

from swarm_mj.cli.mission_options import (
    FLAGS,
    about_option,
    check_in_use,
    combined,
    values_of,
)
from swarm_mj.cli.options import Given, Option, flags_of
from swarm_mj.learning.settings import (
    ORDERLY_SILENCE,
    USUAL_HORIZON,
    PpoSettings,
    Training,
    usual_index_settings,
    usual_settings,
)
from swarm_mj.learning.ways import CreditAssignment
from swarm_mj.mission import PRESETS, Mission
from swarm_mj.policies.gnn.feature_sets import (
    FEATURE_SETS,
    check_named,
    gives_turns,
    is_own_set,
    load_features,
    num_features,
)
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.index.weights import START
from swarm_mj.policies.policy_config import GnnConfig, GnnShape
from swarm_mj.protocol.packets import check_whole
from swarm_mj.simulation.components import OWN_PARTS, Components
from swarm_mj.system.fields import as_typed, meaning_of
from swarm_mj.system.user_code import is_own

PARTS = {  # the dataclasses of settings and their headings in the help, by their dotted place
    "": (Training, "run"),
    "network.": (GnnShape, "network"),
    "ppo.": (PpoSettings, "PPO"),
    "components.": (Components, OWN_PARTS),
    "mission.": (
        Mission,
        "missions, trained on together for several values (not of --windows)",
    ),
}


def _specs() -> dict[str, Field[Any]]:
    """Return the fields that are options, by their dotted place."""
    specs: dict[str, Field[Any]] = {}
    for part, (owner, _) in PARTS.items():
        for spec in fields(owner):
            is_size = spec.name == "num_robots"  # team sizes are the run's own
            if meaning_of(spec).help and not is_size:
                specs[f"{part}{spec.name}"] = spec
    return specs


SPECS_BY_PLACE = _specs()
# What counts for the search of an index, beside missions and parts; credit and networks do not.
OF_INDEX = [
    SPECS_BY_PLACE["policy"],
    SPECS_BY_PLACE["robots"],
    SPECS_BY_PLACE["missions"],
    SPECS_BY_PLACE["train_windows"],
    SPECS_BY_PLACE["seed"],
    SPECS_BY_PLACE["evaluate_every"],
    SPECS_BY_PLACE["held_out"],
]


def setting_options() -> Iterator[Option]:
    """Yield the settings as options, under a heading for each part of the settings."""
    for place, spec in SPECS_BY_PLACE.items():
        _, heading = PARTS[place.removesuffix(spec.name)]
        about = about_option(spec) if place.startswith("mission.") else meaning_of(spec)
        about = replace(about, group=heading, shown=_usual(place))
        # Of missions that are trained on together, all have as many windows.
        is_many = place.startswith("mission.") and spec.name != "num_windows"
        yield Option(spec, about, place, is_many=is_many, is_nested=True)


def given_settings(given: Given) -> Given:
    """Return the settings that were given, by their places; a value of several counts once."""
    settings = {}
    for place in SPECS_BY_PLACE:
        if place not in given:
            continue
        value = given[place]
        if isinstance(value, tuple):
            # In their order, which decides who is trained first.
            value = tuple(dict.fromkeys(value))
        settings[place] = value
    return settings


def asked_settings(
    given: Given, init: GnnConfig | None = None, init_path: Path | None = None
) -> Training:
    """Return the settings of a new run: the usual ones of its credit, changed by those given.

    `init` is the policy that the run begins with. Raise ValueError for what cannot be trained.
    """
    own = _part("", given)
    if are_of_index(given):
        return _index_settings(given)
    network = _part("network", given)
    ppo = _part("ppo", given)
    sizes = own.get("robots", (Mission().num_robots,))
    mission, *others = _missions(_part("mission", given), sizes[0])
    training = usual_settings(
        own.get("credit_assignment", Training.credit_assignment), mission, sizes
    )
    training = replace(training, other_missions=tuple(others))
    if init is not None:
        training = _begun_with(training, init, f"policy {init_path}", given)
    num_kinds = len(training.kinds)
    missions = _num_missions(own.get("missions"), training.missions, num_kinds)
    components = Components(**_part("components", given))
    training = replace(training, missions=missions, components=components)
    # The user's own features count only once they are loaded, and the network is made for them.
    load_own(own.get("features", training.features), own.get("own_network", ""), training)
    if "features" in own:
        network["num_features"] = num_features(own["features"])
        if init is None:
            own = _usual_silence(own, training) | own
    if others and training.credit_assignment == "robot":
        own = {"credit_scaling": "kind"} | own
    ppo = _usual_horizon(training, ppo) | ppo
    training = replace(
        training,
        groups=_num_groups(missions, num_kinds),
        network=replace(training.network, **network),
        ppo=replace(training.ppo, **ppo),
        **own,  # last: what is given for the run itself goes before what follows from the rest
    )
    for kind in training.kinds:
        check_whole("training", kind)
    flocks = all(each.flocks for each in training.all_missions)
    if training.reward == "velocity-variance" and not flocks:
        rule = "reward velocity-variance depends on who talks only if the robots flock"
        raise ValueError(f"{rule}; add --task flocking")
    return training


def are_of_index(given: Given) -> bool:
    """Return whether options ask for an index."""
    return given.get("policy") == IndexCsma.NAME


def _index_settings(given: Given) -> Training:
    """Return the settings of a search for an index; ValueError for options that are of networks."""
    check_of_index(given)
    own = _part("", given)
    sizes = own.get("robots", (Mission().num_robots,))
    mission, *others = _missions(_part("mission", given), sizes[0])
    training = usual_index_settings(mission, sizes)
    training = replace(
        training,
        other_missions=tuple(others),
        components=Components(**_part("components", given)),
        missions=max(training.missions, len(sizes) * (len(others) + 1)),
    )
    training = replace(training, **own)
    load_own(training.features, "", training)
    for kind in training.kinds:
        IndexCsma(kind, START)  # whose packets may fit into no slot
    return training


def check_of_index(given: Given) -> None:
    """Raise ValueError for an option that counts for networks only."""
    for place in given:
        owner, _, _ = place.rpartition(".")
        spec = SPECS_BY_PLACE[place]
        if owner not in ("mission", "components") and spec not in OF_INDEX:
            flag = flags_of(spec)[0]
            raise ValueError(f"{flag} is of training a gnn, not of index-csma; leave it out")


def _usual_silence(own: Given, training: Training) -> Given:
    """Return the logit of silence that suits features with an order of turns, if these are such."""
    features = own["features"]
    is_ours = features in FEATURE_SETS  # only a user knows what the own ones say
    if training.credit_assignment == "robot" and is_ours and gives_turns(features):
        return {"silence_logit": ORDERLY_SILENCE}
    return {}


def _usual_horizon(training: Training, ppo: Given) -> Given:
    """Return the horizon of credits that suits the discount and the rollouts that were given."""
    asked = replace(training.ppo, **{"horizon": 1} | ppo)
    if training.credit_assignment == "team" or asked.discount > 0.0:
        return {"horizon": 1}
    # In the last windows of a rollout no horizon is whole, so nothing is learned of them.
    return {"horizon": min(USUAL_HORIZON, max(1, asked.num_steps // 2))}


def _missions(asked: Given, num_robots: int) -> tuple[Mission, ...]:
    """Return what is flown; raise ValueError for an option that would change nothing."""
    swept = {"task": ("stationary",), "num_robots": (num_robots,)}
    for name, value in asked.items():
        swept[name] = value if isinstance(value, tuple) else (value,)  # a flag has one
    missions = combined(swept)
    check_in_use(asked, missions, FLAGS.__getitem__)
    return tuple(dict.fromkeys(missions))


def _begun_with(training: Training, init: GnnConfig, policy: str, given: Given) -> Training:
    """Return settings that fit a stored policy; raise ValueError if those given say otherwise."""
    training = replace(
        training,
        network=init.network,
        features=init.features,
        silence_logit=init.silence_logit,
        most_speech=init.most_speech,
        own_network=init.own_network,
    )
    of_network: Given = {}
    for place, value in given.items():
        if place.startswith(("features", "network", "own_network")):
            of_network[place] = value
    refuse_others(of_network, training, f"the {policy}")
    check_named(init.features, own_names(given), policy)
    return training


def own_names(given: Given) -> list[str]:
    """Return the names of custom components and features among settings that were given."""
    names: list[str] = []
    for place, value in given.items():
        may_be_own = place.startswith(("features", "own_network", "components."))
        if may_be_own and is_own(value):
            names.append(value)
    return names


def load_own(features: str, network: str, training: Training) -> None:
    """Load a run's own features, network and parts; raise ValueError if one cannot be made."""
    if network:
        from swarm_mj.policies.gnn.own_networks import load_network  # torch is slow to import

        load_network(network)
    if is_own_set(features):
        load_features(features)
    for mission in training.all_missions:
        training.components.made(mission)


def refuse_others(given: Given, training: Training, whose: str) -> None:
    """Raise ValueError if a setting contradicts a run, or the policy that it begins with."""
    for place, value in given.items():
        owner, _, name = place.rpartition(".")
        stored = attrgetter(place)(training)
        if owner == "mission" and isinstance(value, tuple):
            stored = values_of(name, training.all_missions)
        if value != stored:
            typed = f"{flags_of(SPECS_BY_PLACE[place])[0]} {as_typed(value)}"
            raise ValueError(f"{typed} is not what {whose} has, {as_typed(stored)}; leave it out")


def _part(part: str, given: Given) -> Given:
    """Return the settings given of one part, by their names in it."""
    settings: Given = {}
    for place, value in given.items():
        owner, _, name = place.rpartition(".")
        if owner == part:
            settings[name] = value
    return settings


def _num_missions(asked: int | None, usual: int, num_kinds: int) -> int:
    """Return the number of missions side by side: as many of every kind."""
    if asked is None:
        return -(-usual // num_kinds) * num_kinds
    if asked % num_kinds:
        rule = f"missions must be a multiple of the {num_kinds} kinds (team sizes by missions)"
        raise ValueError(f"{rule}, not {asked}")
    return asked


def _num_groups(missions: int, num_kinds: int) -> int:
    """Return a number near to the usual one of groups, each with as many of every kind."""
    able = [n for n in range(num_kinds, missions + 1, num_kinds) if missions % n == 0]
    return min(able, key=lambda n: (abs(n - Training.groups), -n), default=1)


def _usual(place: str) -> str:
    """Return the default as text: per robot and, where it differs, per team."""
    own = meaning_of(SPECS_BY_PLACE[place]).shown
    if own is not None:
        return own
    robot = _usual_of("robot", place)
    team = _usual_of("team", place)
    if robot == "False":  # a flag, which says by itself that it is off
        return ""
    if place == "credit_assignment" or robot == team:
        return robot
    return f"{robot}, team: {team}"


def _usual_of(credit: CreditAssignment, place: str) -> str:
    value_of = attrgetter(place)
    first, second = _usual_runs(credit)
    usual = value_of(first)
    # The two missions differ in preset and task on purpose: of these, the first one's are usual.
    if usual != value_of(second) and place not in ("mission.preset", "mission.task"):
        return "the preset's own"
    return as_typed(usual)


@cache
def _usual_runs(credit: CreditAssignment) -> tuple[Training, Training]:
    """Return the usual settings for two missions, which show what depends on the preset."""
    paper = PRESETS["paper"]("stationary")
    reference = PRESETS["reference"]("flocking")
    return usual_settings(credit, paper, (40,)), usual_settings(credit, reference, (40,))
