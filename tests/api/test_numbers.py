"""Numbers are read by name, as attributes or as keys, and nobody changes them."""

import copy
import pickle

import pytest

from swarm_mj.api.numbers import Numbers

NUMBERS = Numbers({"aoi_mean": 10.123456789, "packets_lost": None, "of one": Numbers({"n": 3})})


def test_they_are_attributes_and_keys():
    assert NUMBERS.aoi_mean == NUMBERS["aoi_mean"] == 10.123456789
    assert dict(NUMBERS) == {"aoi_mean": 10.123456789, "packets_lost": None, "of one": {"n": 3}}
    assert {"aoi_mean", "packets_lost"} <= set(dir(NUMBERS))
    assert len(NUMBERS) == 3


def test_they_are_shown_a_line_each():
    assert repr(NUMBERS) == "aoi_mean      10.1235\npackets_lost  None\nof one\n  n  3"
    assert repr(Numbers({})) == ""


def test_a_slip_is_told_with_the_name_that_was_meant():
    with pytest.raises(AttributeError, match="there is no 'aoi_meen' here; did you mean aoi_mean"):
        _ = NUMBERS.aoi_meen
    assert not hasattr(NUMBERS, "nothing_like_it")
    with pytest.raises(TypeError):
        NUMBERS["aoi_mean"] = 3


def test_they_are_copied_and_pickled():
    assert pickle.loads(pickle.dumps(NUMBERS)) == copy.deepcopy(NUMBERS) == NUMBERS
