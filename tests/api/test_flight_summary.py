"""The summary of a flight: attributes and keys are the same numbers."""

import copy
import json
import pickle
from dataclasses import FrozenInstanceError, fields

import pytest

import swarm_mj
from swarm_mj.api.flight_summary import FlightSummary, as_lines

TINY = {"num_robots": 4, "num_windows": 3, "range_ratio": 2.0, "record": False}


@pytest.fixture(scope="module")
def summary():
    return swarm_mj.fly("stationary", policy="tdma", **TINY).summary


def test_each_number_is_an_attribute_and_a_key(summary):
    names = [spec.name for spec in fields(FlightSummary)]
    assert list(summary) == names
    assert [getattr(summary, name) for name in names] == list(summary.values())
    assert isinstance(summary.aoi_mean, float)
    assert summary.num_windows == 3
    assert summary.packets_delivered is None, "tdma broadcasts"
    assert {"aoi_mean", "packets_lost"} <= set(dir(summary))


def test_it_is_a_dictionary_to_json_copies_and_pickles(summary):
    assert json.loads(json.dumps(summary)) == dict(summary)
    for again in (copy.deepcopy(summary), pickle.loads(pickle.dumps(summary))):
        assert again == summary
        assert again.aoi_mean == summary.aoi_mean


def test_a_number_cannot_be_set_and_a_slip_names_the_one_that_was_meant(summary):
    with pytest.raises(FrozenInstanceError):
        summary.aoi_mean = 0.0
    with pytest.raises(AttributeError, match="there is no 'aoi_meen' here; did you mean aoi_mean"):
        _ = summary.aoi_meen


def test_numbers_are_shown_a_line_each(summary):
    assert len(repr(summary).splitlines()) == len(summary)
    nested = {"aoi_mean": 10.123456789, "packets_lost": None, "of one": {"n": 3}}
    assert as_lines(nested) == "aoi_mean      10.1235\npackets_lost  None\nof one\n  {'n': 3}"
    assert as_lines({}) == ""
