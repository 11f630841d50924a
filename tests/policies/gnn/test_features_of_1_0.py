"""The record of the features of version 1.0.0 is as it was, but for sets that are gone."""

import hashlib
import json
from typing import cast

import pytest

from swarm_mj.policies.gnn.features_of_1_0 import FEATURES_OF_1_0


def test_the_record_is_as_it_was():
    """It must never change, not even together with the code; only a set that is gone leaves it."""
    assert list(FEATURES_OF_1_0) == ["paper", "reference", "local", "extended"]
    digest = hashlib.sha256(json.dumps(dict(FEATURES_OF_1_0)).encode()).hexdigest()
    assert digest[:16] == "b54cbf1fd496bb12"


def test_the_record_cannot_be_changed_while_a_program_runs():
    record = cast(dict[str, tuple[str, ...]], FEATURES_OF_1_0)
    with pytest.raises(TypeError):
        record["extended"] = ()
    assert all(type(names) is tuple for names in FEATURES_OF_1_0.values())


def test_local_features_were_the_extended_ones_but_for_turns():
    extended = FEATURES_OF_1_0["extended"]
    no_turns = tuple(name for name in extended if "turn" not in name)
    assert FEATURES_OF_1_0["local"] == no_turns


@pytest.mark.parametrize("features", FEATURES_OF_1_0)
def test_no_name_stands_twice_in_a_set(features):
    names = FEATURES_OF_1_0[features]
    assert len(set(names)) == len(names)
