"""Policies by their names on the command line: which there are, and `make_policy`.

A name is one of `POLICIES`, the file of a learned policy or its run's folder, or `module:Name` of a
user's own. `POLICIES` are what the classes of this package declare as their `about`, and `gnn`, the
learned policy that comes with it.
"""

import inspect
import os
import pkgutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TypeGuard

from swarm_mj.mission import Mission
from swarm_mj.policies.about import NO_PAYLOAD, About, Listed, VariantOf
from swarm_mj.policies.gnn import feature_sets
from swarm_mj.policies.gnn.shipped import SHIPPED_GNN
from swarm_mj.policies.gnn.turn_features import TurnFeatures
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.learned import LearnedPolicy
from swarm_mj.policies.planner.resting import WITHOUT_PAYLOAD
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import (
    CentralisedPolicy,
    DecentralisedPolicy,
    Policy,
    check_parameters,
)
from swarm_mj.policies.policy_arguments import PolicyArguments
from swarm_mj.policies.policy_config import (
    SUFFIX,
    GnnConfig,
    IndexConfig,
    MlpConfig,
    StoredConfig,
)
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.policies.tuning import tuned_probability
from swarm_mj.system.arguments import check_kind, did_you_mean, unwrapped
from swarm_mj.system.packages import asset, need
from swarm_mj.system.user_code import files_named, is_own, make

PACKAGE = __name__.rpartition(".")[0]
# The modules of trained networks are not imported: they need torch or safetensors, which flying
# other policies does not. Their policies have no names here, but files.
NOT_IMPORTED = ("gnn", "stored")


def policy_classes() -> Iterator[type[Policy]]:
    """Yield the classes of policies in this package, but for trained networks and common bases."""
    folders = sys.modules[PACKAGE].__path__
    for found in pkgutil.walk_packages(folders, f"{PACKAGE}."):
        below_package = found.name.removeprefix(f"{PACKAGE}.").split(".")
        if below_package[0] in NOT_IMPORTED:
            continue
        module = import_module(found.name)
        for each in list(vars(module).values()):  # a copy, as one of the modules is this one
            is_from_here = isinstance(each, type) and each.__module__ == module.__name__
            if is_from_here and _is_policy(each):
                yield each


def _is_policy(kind: type) -> TypeGuard[type[Policy]]:
    if not issubclass(kind, Policy) or issubclass(kind, LearnedPolicy):
        return False
    return kind is not Policy and not inspect.isabstract(kind)


def by_name(classes: Iterable[type[Policy]]) -> dict[str, type[Policy]]:
    """Return classes of policies by the names that they declare.

    Raises TypeError, which names the class, for one that declares nothing, or the name or the place
    in lists of another.
    """
    named: dict[str, type[Policy]] = {}
    ranks = {SHIPPED_GNN.rank: SHIPPED_GNN.name}
    for kind in classes:
        where = f"class {kind.__qualname__} in {kind.__module__}"
        about = kind.about
        if not isinstance(about, Listed):
            raise TypeError(f"{where} must declare what it is: about = Listed(...)")
        if about.name in named or about.name == SHIPPED_GNN.name:
            raise TypeError(f"{where} has the name of another policy, {about.name}")
        if about.rank in ranks:
            raise TypeError(f"{where} has the rank of {ranks[about.rank]}, {about.rank}")
        named[about.name] = kind
        ranks[about.rank] = about.name
    return named


def _in_order(classes: Iterable[type[Policy]]) -> dict[str, Listed]:
    """Return what each policy of the package says of itself, in the order of lists."""
    every = [SHIPPED_GNN]
    every.extend(kind.about for kind in classes if isinstance(kind.about, Listed))
    every.sort(key=lambda about: about.rank)
    return {about.name: about for about in every}


def _variants() -> dict[str, str]:
    """Return the names of policies without their payload, by the policies whose variants they are.

    The option `--payload none` turns a policy into its variant.
    """
    found: dict[str, str] = {}
    for name, about in LISTED.items():
        if isinstance(about.origin, VariantOf) and about.payload is None:
            found[about.origin.policy] = name
    return found


CLASSES = by_name(policy_classes())
LISTED = _in_order(CLASSES.values())
POLICIES = tuple(LISTED)
VARIANTS = _variants()
# What `--payload` takes. At rest the planner's own is links, which this name stands for as well.
PAYLOADS = (*(LISTED[name].payload_name for name in VARIANTS), NO_PAYLOAD)
FLOWN_AS = f"{WITHOUT_PAYLOAD} flies as spatial-tdma where robots move: they agree on no plan"
MOST_WITHOUT_PLAN = PlannerSettings().min_planned_robots - 1
TAKES_TURNS = (
    f"planner flies as tdma in teams of up to {MOST_WITHOUT_PLAN} robots: a plan would gain them "
    "little"
)
HAVE_PROBABILITY = tuple(
    name for name in POLICIES if issubclass(CLASSES.get(name, Policy), RandomTransmission)
)
SHIPPED = SHIPPED_GNN.name  # in assets/policies/


def make_policy(
    name: str,
    mission: Mission,
    probability: float | None = None,
    *,
    is_deterministic: bool = False,
    features: Sequence[str] = (),
    networks: Sequence[str] = (),
) -> Policy:
    """Return a policy by its name, for a mission.

    The mission's preset says how the baselines behave where paper and code differ, and its numbers
    normalise what a learned policy sees.

    Args:
        name: One of `POLICIES`, the file of a learned policy or its run's folder, or `module:Name`
            of your own.
        mission: What is flown.
        probability: Of a transmission, for the policies of `HAVE_PROBABILITY`; unless it is given,
            the one tuned for the regime nearest to the mission's.
        is_deterministic: Whether a learned policy takes the most probable recipient, not a draw.
        features: Own feature sets, as `module:Name`, that may be imported for a learned policy.
        networks: Own networks, likewise.

    Returns:
        The policy, to be started with the mission's swarm.

    Raises:
        ValueError: If the name is unknown, no sound policy is there, or the policy takes no such
            probability or mode.
        OSError: If a file cannot be read.
        TypeError: If there is no name or no mission.

    Example:
        >>> from swarm_mj import make_policy, paper
        >>> make_policy("aloha", paper("flocking"), 0.3).parameters
        {'probability': 0.3}
    """
    arguments = PolicyArguments(
        probability=probability,
        is_deterministic=is_deterministic,
        features=features,
        networks=networks,
    )
    return make_policy_with(arguments, name, mission)


def make_policy_with(arguments: PolicyArguments, name: str, mission: Mission) -> Policy:
    """Return what `make_policy` does, of arguments that are passed on whole."""
    check_kind("policy", name, str, '"planner"')
    check_kind("mission", mission, Mission, 'paper("flocking")')
    name = flown_name(name, mission)
    _check_known(name)
    probability = arguments.probability
    if probability is not None and name not in HAVE_PROBABILITY:
        per_value = "name one policy per value in its file, as `p01 = functools.partial(Mine, 0.1)`"
        hint = f", and {per_value}" if is_own_policy(name) else ""
        raise ValueError(f"{name} takes no transmission probability; leave out {probability}{hint}")
    if is_learned(name):
        return _learned(arguments, name, mission)
    if arguments.is_deterministic:
        raise ValueError(
            f"--deterministic applies to learned policies only, not to {name}; leave it out"
        )
    if is_own_policy(name):
        return _own(name, mission)
    kind = CLASSES[name]
    if not issubclass(kind, RandomTransmission):
        return kind.for_mission(mission)
    if probability is None:
        probability = tuned_probability(name, mission)
    return kind.with_probability(mission, probability)


def _check_known(name: str) -> None:
    """Raise ValueError for a name that no policy can have."""
    if name.endswith(".zip") and not os.path.isdir(name):
        raise ValueError(
            f"policy {name} seems to be a model of stable-baselines3: store it with "
            "swarm_mj.envs.sb3.save_policy, or fly it with swarm_mj.envs.sb3.Flown"
        )
    if not (name in POLICIES or is_stored(name) or is_own_policy(name)):
        raise ValueError(
            f"policy must be one of {', '.join(POLICIES)}, a run's folder or a {SUFFIX} file with "
            f"a learned policy, or module:Name of your own, not {name!r}"
            f"{_hint_at(name)}"
        )


def _hint_at(name: str) -> str:
    """Return how a complaint about a policy's name ends: by what is meant, if that is likely."""
    parts = name.split(",")
    if len(parts) > 1 and not set(parts).isdisjoint(POLICIES):
        return f"; separate several by spaces: `swarm-mj evaluate --policy {' '.join(parts)}`"
    return did_you_mean(name, POLICIES)


def _learned(arguments: PolicyArguments, name: str, mission: Mission) -> Policy:
    # The core of the package flies without these libraries, and torch is slow to import.
    need("torch" if name == SHIPPED else "safetensors", f"policy {name}", "fly another")
    from swarm_mj.policies.stored import load_policy

    policy = load_policy(
        asset(f"policies/{SHIPPED}{SUFFIX}") if name == SHIPPED else Path(name),
        mission,
        is_deterministic=arguments.is_deterministic,
        features=arguments.features,
        networks=arguments.networks,
    )
    if name == SHIPPED:
        policy.about = SHIPPED_GNN
    return policy


def _own(name: str, mission: Mission) -> Policy:
    policy = make("policy", name, mission)
    if not isinstance(policy, CentralisedPolicy | DecentralisedPolicy):
        kinds = "a DecentralisedPolicy or a CentralisedPolicy"
        raise ValueError(f"policy {name} must make {kinds}, not {policy!r:.80}")
    check_parameters(policy)
    return policy


def is_stored(name: str) -> bool:
    """Return whether a policy's name is that of a file or a folder, there or not."""
    is_path = any(separator in name for separator in (os.sep, os.altsep) if separator)
    is_there = os.path.isdir(name) or os.path.isfile(f"{name}{SUFFIX}")
    return name not in POLICIES and (is_path or name.endswith(SUFFIX) or is_there)


def about_of(name: str) -> About | None:
    """Return what a policy by this name says of itself, or None if that is unknown.

    A user's own is not imported for it, since its name may stand in a file: it is known where this
    process has loaded it.
    """
    if name in LISTED:
        return LISTED[name]
    if not is_own_policy(name):
        return None
    module, _, attribute = name.partition(":")
    found = getattr(sys.modules.get(module), attribute, None)
    about = getattr(unwrapped(found), "about", None)
    return about if isinstance(about, About) else None


def is_learned(name: str) -> bool:
    """Return whether training made a policy: the shipped network, or any file of weights."""
    return name == SHIPPED or is_stored(name)


def takes_memory_as(name: str) -> str:
    """Return the name of the policy whose memory a policy takes: its own, but for a stored index.

    A file that cannot be read is said to be unsound where it is loaded.
    """
    return IndexCsma.NAME if isinstance(_stored_config(name), IndexConfig) else name


def remembers_packets(name: str) -> bool:
    """Return whether a learned policy keeps N² numbers of packets for each robot.

    One that cannot be read, or sees by a user's own features that are not loaded, may.
    """
    if name == SHIPPED:
        return TurnFeatures.remembers_packets
    config = _stored_config(name)
    if isinstance(config, GnnConfig | MlpConfig):
        with suppress(ValueError):
            return feature_sets.remembers_packets(config.features)
    return True


def _stored_config(name: str) -> StoredConfig | None:
    """Return the config of a stored policy; None if it is another one, or cannot be read."""
    if not is_stored(name):
        return None
    with suppress(ValueError, OSError, ModuleNotFoundError):
        from swarm_mj.policies.stored import read_weights

        _, config = read_weights(Path(name))
        return config
    return None


def is_own_policy(name: str) -> bool:
    """Return whether a policy is a user's own, named `module:Name`."""
    return is_own(name) and not is_stored(name)


def stored_policies(names: Iterable[str]) -> list[Path]:
    """Return the files and folders among policies' names."""
    return [Path(name) for name in names if is_stored(name)]


def files_of(name: str) -> list[Path]:
    """Return the files and folders that a policy's name leads to: a network's, or users' code."""
    if is_stored(name):
        return [Path(name), Path(f"{name}{SUFFIX}")]
    return files_named(name)


def listed(names: Iterable[str]) -> list[str]:
    """Return policies' names, each once; `all` stands for `POLICIES`, after the others."""
    every = list(names)
    if "all" in every:
        every.extend(POLICIES)
    each_once = dict.fromkeys(every)
    return [name for name in each_once if name != "all"]


def flown_name(name: str, mission: Mission) -> str:
    """Return the name of what flies a mission when a policy is asked for.

    Without a payload, robots that move cannot agree on a plan, so they fly `spatial-tdma`. Tables
    and charts say so, and show it once.
    """
    return "spatial-tdma" if name == WITHOUT_PAYLOAD and mission.moves else name


def note_on(name: str, mission: Mission) -> str:
    """Return what is to be said of a policy that flies a mission otherwise than by its name.

    Args:
        name: Of the policy that was asked for.
        mission: What is flown.

    Returns:
        A line; empty if there is nothing to say.
    """
    if flown_name(name, mission) != name:
        return FLOWN_AS
    is_planner = name in VARIANTS or name in VARIANTS.values()
    return TAKES_TURNS if is_planner and mission.num_robots <= MOST_WITHOUT_PLAN else ""


def with_payload(names: Sequence[str], payload: str) -> list[str]:
    """Return the names of policies with this payload, one of `PAYLOADS`.

    Raises ValueError if there is to be none, and none of the policies has a choice.
    """
    if payload != NO_PAYLOAD:
        return list(names)
    has_choice = {*VARIANTS, *VARIANTS.values()}
    if not has_choice.intersection(names):
        raise ValueError(
            f"--payload says what the planner's packets carry, but not those of "
            f"{', '.join(names)}; leave it out"
        )
    return [VARIANTS.get(name, name) for name in names]


def check_used(
    features: Sequence[str], networks: Sequence[str], policies: Iterable[Policy]
) -> None:
    """Raise ValueError unless own features and networks that were named are those of a policy."""
    used: set[object] = set()
    for policy in policies:
        check_parameters(policy)  # they may be of a user's own, and anything
        used.add(policy.parameters.get("features"))
        used.add(policy.parameters.get("network"))
    for name in features:
        if name not in used:
            raise ValueError(f"no policy here was trained on the features {name}; leave them out")
    for name in networks:
        if name not in used:
            raise ValueError(f"no policy here decides by the network {name}; leave it out")
