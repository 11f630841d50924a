"""The one table of feature sets."""

from swarm_mj.fields import did_you_mean
from swarm_mj.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.gnn.graphs import FeatureExtractor, PaperFeatures, ReferenceFeatures
from swarm_mj.gnn.shape import GnnShape
from swarm_mj.mission import Mission

FEATURE_SETS: dict[str, type[FeatureExtractor]] = {
    "paper": PaperFeatures,
    "reference": ReferenceFeatures,
    "local": LocalFeatures,
    "extended": ExtendedFeatures,
}


def make_extractor(features: str, mission: Mission) -> FeatureExtractor:
    """An extractor by the name of its feature set; it is to be started.

    The mission's area, duration and range normalise the features.

    Raises:
        ValueError: Unknown name.
    """
    return _feature_set(features)(mission)


def num_features(features: str) -> int:
    """How many numbers a feature set has for each node; raises ValueError as `make_extractor`."""
    return len(_feature_set(features).names)


def _feature_set(features: str) -> type[FeatureExtractor]:
    if features not in FEATURE_SETS:
        hint = did_you_mean(features, FEATURE_SETS)
        raise ValueError(
            f"features must be one of {', '.join(FEATURE_SETS)}, not {features!r}{hint}"
        )
    return FEATURE_SETS[features]


def check_fit(network: GnnShape, features: str) -> None:
    """Passes for a network that takes a feature set, and gives what decisions are made of.

    Raises:
        ValueError: It does not, or there is no such feature set.
    """
    expected = num_features(features)
    if network.num_features != expected:
        raise ValueError(
            f"network.num_features is {network.num_features}, but the {features} features are "
            f"{expected}"
        )
    if network.num_outputs not in (1, 2):
        raise ValueError(f"network.num_outputs must be 1 or 2, not {network.num_outputs}")
