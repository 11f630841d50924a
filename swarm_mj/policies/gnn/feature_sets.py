"""The one table of feature sets."""

from collections.abc import Collection

from swarm_mj.mission import Mission
from swarm_mj.mission.components import FORM, load
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.policies.gnn.graphs import FeatureExtractor, PaperFeatures, ReferenceFeatures
from swarm_mj.policies.gnn.shape import GnnShape
from swarm_mj.system.fields import did_you_mean

FEATURE_SETS: dict[str, type[FeatureExtractor]] = {
    "paper": PaperFeatures,
    "reference": ReferenceFeatures,
    "local": LocalFeatures,
    "extended": ExtendedFeatures,
}


_own: dict[str, type[FeatureExtractor]] = {}  # those that the user of this process named


def make_extractor(features: str, mission: Mission) -> FeatureExtractor:
    """Return an extractor by the name of its feature set; it is to be started.

    The mission's area, duration and range normalise the features.

    Raises:
        ValueError: Unknown name, or a user's own that was not loaded by `load_features`.
    """
    return _feature_set(features)(mission)


def num_features(features: str) -> int:
    """How many numbers a feature set has for each node; raises ValueError as `make_extractor`."""
    return len(_feature_set(features).names)


def _feature_set(features: str) -> type[FeatureExtractor]:
    check_features(features)
    if features in FEATURE_SETS:
        return FEATURE_SETS[features]
    check_named(features, _own, "it")
    return _own[features]


def load_features(features: str) -> None:
    """Import a user's own feature set, `module:Name`, which from then on has that name.

    That runs its code, so the name must be one that the user gave, and none from a file.

    Raises:
        ValueError: It cannot be loaded, or is no class of a `FeatureExtractor` with names.
    """
    own = load("features", features)
    if not isinstance(own, type) or not issubclass(own, FeatureExtractor):
        raise ValueError(f"features {features} must be a FeatureExtractor's class, not {own!r:.80}")
    if not getattr(own, "names", ()):
        raise ValueError(f"features {features} must have names, one for each number of a node")
    _own[features] = own


def is_own_set(features: str) -> bool:
    """Whether a feature set is a user's own, named `module:Name`."""
    return FORM.fullmatch(features) is not None


def check_features(features: str) -> None:
    """Pass if a name is that of a feature set, or could be that of a user's own.

    It imports nothing, so the name may stand in a file.

    Raises:
        ValueError: It is neither.
    """
    if features not in FEATURE_SETS and not is_own_set(features):
        raise ValueError(
            f"features must be one of {', '.join(FEATURE_SETS)}, or module:Name of your own, not "
            f"{features!r:.80}{did_you_mean(features, FEATURE_SETS)}"
        )


def check_named(features: str, named: Collection[str], where: str) -> None:
    """Pass unless a file names a user's own feature set that its user has not named, too.

    Raises:
        ValueError: It does: to load it would run code that a file chose.
    """
    if is_own_set(features) and features not in named:
        raise ValueError(
            f"{where} sees by features of someone's own, {features:.200}; if you trust that code, "
            f"add --features {features:.200}"
        )


def trained_extractor(
    features: str, num_features: int, mission: Mission, *, named: Collection[str], where: str
) -> FeatureExtractor:
    """Return an extractor of what a stored network, which `where` calls, was trained on.

    A user's own set is imported, but only if it is among those that the user named.

    Raises:
        ValueError: It is not, it cannot be loaded, or it now has another number of features.
    """
    check_named(features, named, where)
    if is_own_set(features):
        load_features(features)
    extractor = make_extractor(features, mission)
    if len(extractor.names) != num_features:
        raise ValueError(
            f"{where} was trained on {num_features} features, and {features} now has "
            f"{len(extractor.names)}"
        )
    return extractor


def check_num_features(given: int, features: str) -> None:
    """Pass if a feature set has so many numbers for each node, or is a user's own.

    That is not imported, as the name may stand in a file: it may have any number.

    Raises:
        ValueError: It has not, or there is no such feature set.
    """
    check_features(features)
    expected = given if is_own_set(features) else num_features(features)
    if given != expected:
        raise ValueError(
            f"network.num_features is {given}, but the {features} features are {expected}"
        )


def check_fit(network: GnnShape, features: str) -> None:
    """Pass for a network that takes a feature set, and gives what decisions are made of.

    Raises:
        ValueError: It does not; as `check_num_features`.
    """
    check_num_features(network.num_features, features)
    if network.num_outputs not in (1, 2):
        raise ValueError(f"network.num_outputs must be 1 or 2, not {network.num_outputs}")
