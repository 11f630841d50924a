"""The one table of feature sets."""

from swarm_mj.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.gnn.graphs import FeatureExtractor, PaperFeatures, ReferenceFeatures
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
        raise ValueError(f"features must be one of {', '.join(FEATURE_SETS)}, not {features!r}")
    return FEATURE_SETS[features]
