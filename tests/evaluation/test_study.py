"""What a study is made of, and what it refuses."""

import json

import pytest

from swarm_mj.evaluation.study import BATCH_SIZE, Study
from swarm_mj.mission import paper

SMALL = paper("random-walk", num_robots=6)
LARGE = paper("random-walk", num_robots=8)


def study(**overrides):
    return Study(**({"policies": ("mst", "round-robin"), "regimes": (SMALL, LARGE)} | overrides))


def test_batches_hold_every_seed_of_every_policy_and_regime_once():
    batches = study(episodes=2 * BATCH_SIZE + 3, seed=7).batches
    for regime in (SMALL, LARGE):
        for policy in ("mst", "round-robin"):
            own = [b for b in batches if b.mission == regime and b.policy == policy]
            assert [len(b.seeds) for b in own] == [BATCH_SIZE, BATCH_SIZE, 3]
            assert [s for b in own for s in b.seeds] == list(range(7, 7 + 2 * BATCH_SIZE + 3))
    assert len(batches) == 4 * 3


def test_one_behaviour_has_one_name_in_each_regime():
    """Without a payload, teams that move fly spatial-tdma: it is shown once, also as baseline."""
    regimes = (SMALL, paper("stationary", num_robots=6))
    names = ("planner --payload none", "spatial-tdma", "tdma")
    flown = [name for _, name in study(policies=names, regimes=regimes).pairs]
    assert flown == ["spatial-tdma", "tdma", *names]


def test_the_header_tells_what_costs_depend_on():
    header = study(policies=("mst",), probability=0.2, episodes=3, seed=9).header()
    assert header == json.loads(json.dumps(header))
    assert (header["episodes"], header["seed"], header["baseline"]) == (3, 9, "mst")
    assert header["version"]
    first, second = header["policies and regimes"]
    assert (first["num_robots"], second["num_robots"]) == (6, 8)
    assert first["probability"] == second["probability"] == 0.2
    assert first["sinr_threshold_db"] == 1.0
    assert first["failure_fraction"] == 0.0


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        ({"policies": ()}, "at least 1 policy and 1 regime"),
        ({"regimes": ()}, "at least 1 policy and 1 regime"),
        ({"policies": ("magic",)}, "policy must be one of .*, not 'magic'"),
        ({"episodes": 0}, "episodes must be a whole number from 1 to 100000, not 0"),
        ({"episodes": -3}, "episodes must be a whole number from 1 to 100000, not -3"),
        ({"seed": -1}, "seed must be from 0 to .*, not -1"),
        ({"seed": 2**63 - 1}, "seed must be from 0 to 9223372036854775708, .* 100 missions"),
        ({"probability": 1.5}, "probability must be a number from 0 to 1, not 1.5"),
        ({"baseline": "random-flooding"}, "not .random-flooding.; add it to them"),
    ],
)
def test_what_a_study_refuses(overrides, complaint):
    with pytest.raises(ValueError, match=complaint):
        study(**({"policies": ("mst",)} | overrides))


def test_the_last_seed_is_allowed():
    assert study(seed=2**63 - 100).batches[-1].seeds[-1] == 2**63 - 1


@pytest.mark.slow
def test_more_missions_than_can_be_listed_are_refused():
    """Before policies are made for them."""
    regimes = tuple(paper(num_robots=n) for n in range(2, 1003))
    rule = r"up to 10000000 missions, not 100100000 \(100000 missions x 1001 regimes x 1 policies\)"
    with pytest.raises(ValueError, match=rule):
        Study(policies=("tdma",), regimes=regimes, episodes=100_000)


def test_more_regimes_than_fit_are_refused(monkeypatch):
    monkeypatch.setattr("swarm_mj.evaluation.study.MAX_REGIMES", 2)
    regimes = tuple(paper(num_robots=n) for n in (2, 3, 4))
    with pytest.raises(ValueError, match="up to 2 regimes, not 3; fly them in several studies"):
        Study(policies=("tdma",), regimes=regimes)
