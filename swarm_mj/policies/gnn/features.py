"""A feature: one number that a node of a robot's graph tells of a teammate (III-A).

A class of such numbers is declared once, a field a feature, in the network's order:

    class Node:
        is_known: Annotated[float, Feature("is known")]
        distance: Annotated[float, Feature("distance")]

It is never made. Compiled functions write arrays of its `dtype_of`, field by field, so a variable
that is said to be a `Node` lets the type checker find a misspelt one.
"""

from typing import NamedTuple, get_type_hints

import numpy as np


class Feature(NamedTuple):
    """The meaning of a node's field."""

    name: str  # in a few words; stored policies keep it
    needs_turns: bool = False  # whether it follows from an order of the team and from the clock


def features_of(node: type) -> dict[str, Feature]:
    """Return a node's features by field, in the network's order.

    Raises:
        TypeError: A field is not of the form `Annotated[float, Feature(...)]`.
    """
    features: dict[str, Feature] = {}
    for field, annotation in get_type_hints(node, include_extras=True).items():
        said = getattr(annotation, "__metadata__", ())
        if len(said) != 1 or not isinstance(said[0], Feature):
            raise TypeError(f"{node.__name__}.{field} must be Annotated[float, Feature(...)]")
        features[field] = said[0]
    return features


def names_of(node: type) -> tuple[str, ...]:
    """Return the names of a node's features, in the network's order."""
    return tuple(feature.name for feature in features_of(node).values())


def dtype_of(node: type) -> np.dtype:
    """Return what an array of nodes is made of: single-precision numbers, by field."""
    return np.dtype([(field, np.float32) for field in features_of(node)])
