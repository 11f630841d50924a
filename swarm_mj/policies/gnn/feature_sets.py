"""The one table of feature sets, those that a user brings, and what stored networks saw."""

from collections.abc import Collection, Sequence
from itertools import zip_longest

from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.policies.gnn.features_of_1_0 import FEATURES_OF_1_0
from swarm_mj.policies.gnn.graphs import FeatureExtractor, PaperFeatures, ReferenceFeatures
from swarm_mj.policies.gnn.turn_features import TurnFeatures
from swarm_mj.system.arguments import did_you_mean
from swarm_mj.system.user_code import FORM, load

FEATURE_SETS: dict[str, type[FeatureExtractor]] = {
    "paper": PaperFeatures,
    "reference": ReferenceFeatures,
    "turns": TurnFeatures,
    "local": LocalFeatures,
    "extended": ExtendedFeatures,
}
# A name in a file must not make us import code, so a user's own sets are found here alone, where
# `load_features` puts those that the user of this process named.
_own: dict[str, type[FeatureExtractor]] = {}


def make_extractor(features: str, mission: Mission) -> FeatureExtractor:
    """Return an extractor by the name of its feature set; it is to be started.

    Args:
        features: One of `FEATURE_SETS`, or a user's own, `module:Name`, after `load_features`.
        mission: Its area, duration and range normalise the features.

    Returns:
        The extractor.

    Raises:
        ValueError: The name is unknown, or a user's own that was not loaded.

    Example:
        >>> extractor = make_extractor("extended", paper("stationary"))
        >>> extractor.start(num_missions=1, num_robots=40)
    """
    return _feature_set(features)(mission)


def num_features(features: str) -> int:
    """Return the count of a node's numbers in a feature set.

    Args:
        features: One of `FEATURE_SETS`, or a user's own, `module:Name`, after `load_features`.

    Returns:
        F, the numbers that describe one teammate.

    Raises:
        ValueError: The name is unknown, or a user's own that was not loaded.
    """
    return len(_feature_set(features).names)


def uses(features: str) -> str:
    """Return what a set is made of, in a few words; raises as `make_extractor`."""
    return _feature_set(features).uses


def remembers_packets(features: str) -> bool:
    """Return whether a set keeps packets, N² numbers a robot; raises as `make_extractor`."""
    return _feature_set(features).remembers_packets


def gives_turns(features: str) -> bool:
    """Return whether robots take turns in a common order by a set; raises as `make_extractor`."""
    return _feature_set(features).gives_turns


def known_names(features: str) -> tuple[str, ...]:
    """Return the names of a set's features, in order; none of a user's own that is not loaded."""
    known = FEATURE_SETS | _own
    return known[features].names if features in known else ()


def check_unchanged(features: str, trained_on: Sequence[str], what: str) -> None:
    """Raise ValueError unless a set's features are those that a network was trained on, in order.

    A user's own set is not compared until it is loaded.

    Args:
        features: The set's name.
        trained_on: The names that the network's file holds. Empty: it is of version 1.0.0, which
            did not name them; so they are those of the set as it was then.
        what: The network, for the message.
    """
    then = trained_on or FEATURES_OF_1_0.get(features, ())
    now = known_names(features)
    if not then or not now:
        return
    for number, (its, ours) in enumerate(zip_longest(then, now), start=1):
        if its != ours:
            was = f'"{its}"' if its else "nothing"
            has = f'"{ours}"' if ours else "nothing"
            raise ValueError(
                f"{what} was trained on other {features} features: number {number} of them was "
                f"{was} and is {has} now; use it with the version that made it, or train another "
                "with `swarm-mj train`"
            )


def _feature_set(features: str) -> type[FeatureExtractor]:
    check_named(features, _own, "it")
    if features == "buffer":
        raise ValueError(
            "the features buffer were removed after version 1.0, and turns take their place: fly "
            "the policy with the version that made it, or train another"
        )
    if features not in FEATURE_SETS | _own:
        raise ValueError(
            f"features must be one of {', '.join(FEATURE_SETS)}, or module:Name of your own, not "
            f"{features!r:.80}{did_you_mean(features, FEATURE_SETS)}"
        )
    return (FEATURE_SETS | _own)[features]


def load_features(features: str) -> None:
    """Import a user's own feature set, `module:Name`, which from then on has that name.

    That runs its code, so the name must be one that the user gave, and none from a file.

    Args:
        features: `module:Name` of a `FeatureExtractor`'s class that has `names`; the current folder
            is searched first.

    Raises:
        ValueError: It cannot be loaded, or is no class of a `FeatureExtractor` with names.

    Example:
        >>> load_features("my_features:Mine")
        >>> num_features("my_features:Mine")
    """
    own = load("features", features)
    if not isinstance(own, type) or not issubclass(own, FeatureExtractor):
        raise ValueError(f"features {features} must be a FeatureExtractor's class, not {own!r:.80}")
    if not getattr(own, "names", ()):
        raise ValueError(
            f"features {features}: class {own.__name__} needs a class attribute names, one string "
            "per input"
        )
    _own[features] = own


def is_own_set(features: str) -> bool:
    """Return whether a feature set is a user's own, named `module:Name`."""
    return FORM.fullmatch(features) is not None


def check_named(features: str, named: Collection[str], where: str) -> None:
    """Raise ValueError if a file names a user's own feature set that its user has not named too."""
    if is_own_set(features) and features not in named:
        raise ValueError(
            f"{where} sees by features of someone's own, {features:.200}; if you trust that code, "
            f"add --features {features:.200}"
        )
