"""The learning bench measures what it says; how fast is not tested, for machines are shared."""

import pytest

from swarm_mj.cli.benchmark.learning import learning_rows


@pytest.fixture(scope="module")
def rows():
    return list(learning_rows(num_robots=4, seconds=0.05))


def test_networks_are_timed_alone_and_by_the_batch(rows):
    for first, missions in ((0, "1 mission"), (3, "32 missions")):
        forward, layers, backward = rows[first : first + 3]
        assert forward.name == f"the paper's network, {missions}: team decisions"
        assert 0.0 < backward.value < forward.value
        assert layers.value > 1.0


def test_both_arms_train_and_both_networks_decide(rows):
    named = {row.name: row.value for row in rows}
    for name in (
        *("train --credit robot: team decisions", "train --credit team: team decisions"),
        *(f"one robot's decision, network of {whose}" for whose in ("--credit robot", "the paper")),
    ):
        assert named[name] > 0.0
