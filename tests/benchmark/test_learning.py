"""The learning bench measures what it says; how fast is not tested, for machines are shared."""

import pytest

from swarm_mj.benchmark.learning import NetworkTiming, bench_learning


@pytest.fixture(scope="module")
def timing():
    return bench_learning(num_robots=4, seconds=0.05)


def test_networks_are_timed_alone_and_by_the_batch(timing):
    assert [each.num_missions for each in timing.networks] == [1, 32]
    for each in timing.networks:
        assert 0.0 < each.backward_per_s < each.forward_per_s
        assert each.layer_us > 0.0


def test_both_arms_train_and_both_networks_decide(timing):
    assert set(timing.training_per_s) == {"robot", "team"}
    assert set(timing.own_decision_us) == {"arm robot's", "the paper's"}
    assert all(value > 0.0 for value in timing.training_per_s.values())
    assert all(value > 0.0 for value in timing.own_decision_us.values())


def test_a_decision_in_layers():
    each = NetworkTiming(num_missions=1, forward_per_s=200.0, backward_per_s=50.0, layer_us=100.0)
    assert each.forward_in_layers == pytest.approx(50.0)
