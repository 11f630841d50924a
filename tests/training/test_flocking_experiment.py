"""The experiment on flocking, on a small scale."""

import csv
import math

import flocking_converges as experiment
import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.exit_codes import DONE

MISSION = paper("flocking", num_robots=6, num_windows=120, range_ratio=1.0)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Both tables' rows."""
    folder = tmp_path_factory.mktemp("flown")
    settings = experiment.Settings(
        mission=MISSION,
        num_missions=3,
        late_missions=2,
        sizes=(6,),
        out=folder / "courses.csv",
        late=folder / "late.csv",
    )
    assert experiment.run(settings) == DONE
    found = []
    for path in (settings.out, settings.late):
        with path.open(newline="") as file:
            found.append(list(csv.DictReader(file)))
    return found


def test_a_course_has_the_percentiles_of_the_flocks_velocity_variance(tables):
    courses, _ = tables
    assert len(courses) == 5 * 120
    rows = [row for row in courses if row["policy"] == "round-robin"]
    assert [row["window"] for row in rows] == [str(window) for window in range(1, 121)]
    swarm = Swarm(MISSION, [980_000, 980_001, 980_002])
    for row, _ in zip(rows, rollout(swarm, make_policy("round-robin", MISSION)), strict=True):
        spread = np.sort(swarm.states.velocity_mps.var(axis=1).sum(axis=1))
        # Of three numbers, 10 % lie below the first and a fifth of the way to the second.
        low = spread[0] + 0.2 * (spread[1] - spread[0])
        high = spread[2] - 0.2 * (spread[2] - spread[1])
        found = [float(row[f"variance_{each}"]) for each in ("p10", "median", "p90")]
        np.testing.assert_allclose(found, [low, spread[1], high], rtol=1e-4)
        known = np.mean(np.sum(swarm.buffers.timestamp > 0.0, axis=2))
        assert float(row["known_mean"]) == pytest.approx(known, rel=1e-4)


def test_late_rates_are_of_flocks_in_which_all_have_heard_of_all(tables):
    _, late = tables
    assert [row["policy"] for row in late] == list(experiment.POLICIES)
    for row in late:
        assert row["num_robots"] == "6"
        assert float(row["age_mean"]) > 0.5
        assert 0.0 < float(row["stale_rate"]) < -2.0 * math.log(0.9)
        assert int(row["flocks"]) <= 2


def test_a_late_rate_is_the_slope_after_all_have_heard_of_all():
    flown = experiment.fly(MISSION, "round-robin", range(980_000, 980_002))
    rates = experiment.late_rates(flown)
    for b, rate in enumerate(rates):
        variance = flown.variance_m2ps2[:, b]
        first = int(flown.summary.complete_window[b]) - 1
        last = next((t for t in range(120) if variance[t] < 1e-12 * variance[0]), 119)
        assert last - first >= 20
        assert variance[first] * math.exp(-rate * (last - first)) == pytest.approx(variance[last])


def counts(*ages):
    """As many pairs of each age [windows]."""
    return np.bincount([2 * age for age in ages])


def test_news_of_one_age_slows_nothing_down():
    law = -2.0 * math.log(0.9)
    for ages in ([0], [10], [43, 43]):
        assert experiment.stale_rate(counts(*ages), 40, 0.1) == pytest.approx(law)


def test_the_stale_rate_solves_its_equation_by_hand():
    """Of news that is new or 10 windows old, half each: r^-age has a deviation of (r^-10 - 1) / 2.

    Large teams lose less by it.
    """
    rates = [experiment.stale_rate(counts(0, 10), size, 0.1) for size in (10, 40, 160)]
    for size, rate in zip((10, 40, 160), rates, strict=True):
        r = math.exp(-rate / 2.0)
        assert r - 0.9 == pytest.approx(0.1 * (r**-10 - 1.0) / 2.0 / math.sqrt(size), rel=1e-6)
    assert rates[0] < rates[1] < rates[2] < -2.0 * math.log(0.9)


def test_the_stale_rate_is_that_of_a_team_whose_news_keep_their_ages():
    """Within 5 %: a plain loop over 40 robots whose pairs have ages of 10 to 30 windows."""
    rng = np.random.default_rng(1)
    found = []
    for _ in range(5):
        age = rng.integers(10, 31, (40, 40))
        velocity = np.zeros((500, 40))
        velocity[0] = rng.uniform(-1.0, 1.0, 40)
        for t in range(499):
            known = velocity[np.maximum(t - age, 0), np.arange(40)]
            velocity[t + 1] = 0.9 * velocity[t] + 0.1 * known.mean(axis=1)
        variance = velocity.var(axis=1)
        found.append(math.log(variance[100] / variance[220]) / 120)
    ages = np.zeros(61)
    ages[20:62:2] = 1
    assert np.median(found) == pytest.approx(
        experiment.stale_rate(ages.astype(int), 40, 0.1), rel=0.1
    )
