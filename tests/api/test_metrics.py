"""Metrics are read by name, as attributes or as keys."""

import copy
import pickle

import pytest

from swarm_mj.api.metrics import Metrics

METRICS = Metrics({"aoi_mean": 10.123456789, "packets_lost": None, "of one": Metrics({"n": 3})})


def test_they_are_attributes_and_keys():
    assert METRICS.aoi_mean == METRICS["aoi_mean"] == 10.123456789
    assert dict(METRICS) == {"aoi_mean": 10.123456789, "packets_lost": None, "of one": {"n": 3}}
    assert {"aoi_mean", "packets_lost"} <= set(dir(METRICS))
    assert len(METRICS) == 3


def test_they_are_shown_a_line_each():
    assert repr(METRICS) == "aoi_mean      10.1235\npackets_lost  None\nof one\n  n  3"
    assert repr(Metrics({})) == ""


def test_a_slip_is_told_with_the_name_that_was_meant():
    with pytest.raises(AttributeError, match="there is no 'aoi_meen' here; did you mean aoi_mean"):
        _ = METRICS.aoi_meen
    assert not hasattr(METRICS, "nothing_like_it")


def test_they_are_copied_and_pickled():
    assert pickle.loads(pickle.dumps(METRICS)) == copy.deepcopy(METRICS) == METRICS
