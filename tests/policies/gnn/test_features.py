"""A node's features are its fields, in the order in which they stand."""

from typing import Annotated

import numpy as np
import pytest

from swarm_mj.policies.gnn.features import Feature, dtype_of, features_of, names_of


class Node:
    is_known: Annotated[float, Feature("is known")]
    rank: Annotated[float, Feature("rank of its turn", needs_turns=True)]
    age: Annotated[float, Feature("age of T")]


def test_fields_names_and_numbers_are_in_the_same_order():
    assert list(features_of(Node)) == ["is_known", "rank", "age"]
    assert names_of(Node) == ("is known", "rank of its turn", "age of T")
    assert [feature.needs_turns for feature in features_of(Node).values()] == [False, True, False]
    nodes = np.zeros(2, dtype_of(Node))
    nodes["age"] = 7.0
    assert nodes.view(np.float32).reshape(2, 3).tolist() == [[0.0, 0.0, 7.0]] * 2


@pytest.mark.parametrize("annotation", [float, Annotated[float, "age"]])
def test_a_field_that_says_nothing_is_refused(annotation):
    class Mute:
        __annotations__ = {"age": annotation}

    with pytest.raises(TypeError, match=r"Mute\.age must be Annotated\[float, Feature"):
        features_of(Mute)
