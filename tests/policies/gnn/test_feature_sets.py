"""The table of feature sets: their names and sizes, and what stored policies know of them."""

import inspect
import re

import pytest
from declared import where_text

from swarm_mj.mission import paper
from swarm_mj.policies.gnn import feature_sets
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.policies.gnn.feature_sets import (
    FEATURE_SETS,
    check_unchanged,
    gives_turns,
    known_names,
    make_extractor,
    num_features,
)
from swarm_mj.policies.gnn.features_of_1_0 import FEATURES_OF_1_0
from swarm_mj.policies.gnn.graphs import PaperFeatures, ReferenceFeatures
from swarm_mj.policies.gnn.turn_features import TurnFeatures


@pytest.mark.parametrize(
    ("features", "kind", "count"),
    [
        ("paper", PaperFeatures, 1 + 1 + 1 + 2 + 2 + 1),  # two flags, T, p, v, L (III-A)
        ("reference", ReferenceFeatures, 7),
        ("turns", TurnFeatures, 50),
        ("local", LocalFeatures, 18 - 5),  # without the turns agreed beforehand
        ("extended", ExtendedFeatures, 18),
    ],
)
def test_a_set_is_found_by_its_name_and_has_so_many_features(features, kind, count):
    assert type(make_extractor(features, paper())) is kind
    assert num_features(features) == count


def test_only_the_extended_features_give_turns_in_an_order_of_the_team():
    assert [name for name in FEATURE_SETS if gives_turns(name)] == ["extended"]


@pytest.mark.parametrize("refuse", [lambda name: make_extractor(name, paper()), num_features])
def test_unknown_features_are_a_clear_error(refuse):
    assert set(FEATURE_SETS) == {"paper", "reference", "turns", "local", "extended"}
    with pytest.raises(ValueError, match="extended, or module:Name of your own, not 'all'"):
        refuse("all")
    with pytest.raises(ValueError, match="and turns take their place"):
        refuse("buffer")


@pytest.mark.parametrize("features", FEATURES_OF_1_0)
def test_the_sets_are_what_policies_of_1_0_were_trained_on(features):
    """Who changes a set makes all policies trained on it useless, `gnn` too: make one of your own.

    Two features that change places are named, with the file they stand in.
    """
    file = inspect.getfile(FEATURE_SETS[features])
    now = FEATURE_SETS[features].names
    then = FEATURES_OF_1_0[features]
    for number, (its, was) in enumerate(zip(now, then, strict=False), start=1):
        place = where_text(file, f'"{re.escape(its)}"')
        changed = f"{place}: number {number} of the {features} features was {was!r} and is {its!r}"
        assert its == was, f"{changed} now"
    assert len(now) == len(then), f"{file}: another number of {features} features"


NAMES = FEATURES_OF_1_0["extended"]
SWAPPED = (*NAMES[:2], NAMES[3], NAMES[2], *NAMES[4:])


@pytest.mark.parametrize(
    ("now", "said"),
    [
        (SWAPPED, 'number 3 of them was "age of T" and is "distance" now'),
        (NAMES[:-1], 'number 18 of them was "size of the team" and is nothing now'),
        ((*NAMES, "battery"), 'number 19 of them was nothing and is "battery" now'),
        ((*NAMES[:-1], "battery"), 'number 18 of them was "size of the team" and is "battery" now'),
    ],
)
@pytest.mark.parametrize("trained_on", [NAMES, ()], ids=["named", "of 1.0.0"])
def test_features_that_changed_are_refused_by_the_first_that_differs(
    monkeypatch, now, said, trained_on
):
    check_unchanged("extended", trained_on, "policy mine")
    monkeypatch.setattr(ExtendedFeatures, "names", now)
    with pytest.raises(
        ValueError, match=r"^policy mine was trained on other extended features: "
    ) as refused:
        check_unchanged("extended", trained_on, "policy mine")
    assert said in str(refused.value)
    assert str(refused.value).endswith("or train another with `swarm-mj train`")


def test_a_users_own_set_has_names_once_it_is_loaded(monkeypatch):
    own = "swarm_mj.policies.gnn.graphs:PaperFeatures"
    monkeypatch.setattr(feature_sets, "_own", {})
    assert known_names(own) == ()
    check_unchanged(own, ("age",), "policy mine")
    feature_sets.load_features(own)
    assert known_names(own) == PaperFeatures.names
    check_unchanged(own, (), "policy mine")  # of 1.0.0: only their number was known
    with pytest.raises(ValueError, match='number 1 of them was "age" and is "is oneself" now'):
        check_unchanged(own, ("age",), "policy mine")
