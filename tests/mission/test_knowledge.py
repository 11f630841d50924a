"""What robots may know before a mission, and how it is said."""

import runpy

import pytest

from swarm_mj.mission import specification

# As users load it: without the type checks that these tests run under, which would answer first.
Unchecked = runpy.run_path(specification.__file__)["Mission"]


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("nothing", "nothing"),
        ("start", "start"),
        ("start,map,statistics,map", "map,statistics,start"),
        ("start, map", "map,start"),
    ],
)
def test_what_is_known_has_one_order(given, kept):
    mission = Unchecked(prior_knowledge=given)
    assert mission.prior_knowledge == kept
    granted = [what for what in ("map", "statistics", "start") if mission.grants(what)]
    assert granted == [what for what in kept.split(",") if what != "nothing"]


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ("mapp", "not 'mapp'; did you mean map?"),
        ("map,", "or several joined by commas, not ''"),
        ("map statistics", "not 'map statistics'"),
        ("map,nothing", "nothing or some of map, statistics, start, not nothing,map"),
        (3, "not 3"),
    ],
)
def test_what_cannot_be_known_is_refused(given, complaint):
    with pytest.raises(ValueError, match=r"^prior knowledge must be") as refusal:
        Unchecked(prior_knowledge=given)
    assert complaint in str(refusal.value)
