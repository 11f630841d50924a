"""The table of feature sets: their names and their sizes."""

import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.gnn.buffer_features import BufferFeatures
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.policies.gnn.feature_sets import FEATURE_SETS, make_extractor, num_features
from swarm_mj.policies.gnn.graphs import PaperFeatures, ReferenceFeatures


@pytest.mark.parametrize(
    ("features", "kind", "count"),
    [
        ("paper", PaperFeatures, 1 + 1 + 1 + 2 + 2 + 1),  # two flags, T, p, v, L (III-A)
        ("reference", ReferenceFeatures, 7),
        ("buffer", BufferFeatures, 21),
        ("local", LocalFeatures, 18 - 5),  # without the turns agreed beforehand
        ("extended", ExtendedFeatures, 18),
    ],
)
def test_a_set_is_found_by_its_name_and_has_so_many_features(features, kind, count):
    assert type(make_extractor(features, paper())) is kind
    assert num_features(features) == count


@pytest.mark.parametrize("refuse", [lambda name: make_extractor(name, paper()), num_features])
def test_unknown_features_are_a_clear_error(refuse):
    assert set(FEATURE_SETS) == {"paper", "reference", "buffer", "local", "extended"}
    with pytest.raises(ValueError, match="extended, or module:Name of your own, not 'all'"):
        refuse("all")
