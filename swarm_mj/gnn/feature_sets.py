"""The one table of feature sets."""

from collections.abc import Callable

from swarm_mj.gnn.extended_features import ExtendedObserver, LocalObserver
from swarm_mj.gnn.graphs import Observer, PaperObserver, ReferenceObserver
from swarm_mj.mission import Mission

OBSERVERS: dict[str, Callable[[Mission], Observer]] = {
    "paper": PaperObserver,
    "reference": ReferenceObserver,
    "local": LocalObserver,
    "extended": ExtendedObserver,
}


def make_observer(features: str, mission: Mission) -> Observer:
    """An observer by the name of its feature set.

    Args:
        features: A key of `OBSERVERS`.
        mission: Whose area, duration and range normalise the features.

    Returns:
        The observer; it is to be started.

    Raises:
        ValueError: Unknown name.
    """
    if features not in OBSERVERS:
        raise ValueError(f"features must be one of {', '.join(OBSERVERS)}, not {features!r}")
    return OBSERVERS[features](mission)
