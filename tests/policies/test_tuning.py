import itertools
from dataclasses import replace

import pytest

from swarm_mj.mission import PRESETS, WORLDS, paper, reference
from swarm_mj.policies import tuning
from swarm_mj.policies.tuning import TABLE, Tuned, read_table, tuned_probability

AUTHORS_GRID = {0.04, 0.06, 0.08, 0.1, 0.12, 0.15}
POLICIES = ("random-flooding", "mst", "aloha", "csma", "gossip")
# The regimes of the paper's result figures (IV-B): task, robots, range, velocity.
REGIMES = [
    *[("stationary", 40, ratio, 0.15) for ratio in (0.2, 0.25, 0.5, 0.75, 1.0)],
    *[("random-walk", size, 0.25, 0.15) for size in (10, 20, 40, 60, 80)],
    *[("flocking", 40, 0.25, ratio) for ratio in (0.15, 0.25, 0.325, 0.5)],
]
HEADER = ",".join(Tuned.__annotations__)
ROW = "\nmst,paper,flocking,40,0.25,0.15,0.1,20,1,50,5000,0,\n"


def row(probability, **its):
    usual = {"task": "flocking", "num_robots": 40, "range_ratio": 0.25, "velocity_ratio": 0.15}
    usual |= {"policy": "mst", "preset": "paper", "aoi_mean": 40.0, "aoi_sem": 1.0}
    usual |= {"episodes": 50, "first_seed": 5000, "version": "0", "commit": ""}
    return Tuned(probability=probability, **usual | its)


def found(monkeypatch, rows, *regime, **overrides):
    monkeypatch.setattr(tuning, "_table", lambda: rows)
    return tuned_probability("mst", paper(*regime, **overrides))


def test_iv_c_every_regime_of_the_figures_is_tuned_once_for_each_policy():
    columns = ("policy", "preset", "task", "num_robots", "range_ratio", "velocity_ratio")
    regimes = [tuple(getattr(row, name) for name in columns) for row in read_table(TABLE)]
    named = itertools.product(POLICIES, ("paper", "reference"), REGIMES)
    assert regimes == [(policy, preset, *regime) for policy, preset, regime in named]


def test_iv_c_rows_say_how_they_were_found_and_are_met_exactly():
    """On enough missions, none of them an evaluation's; as the authors did, under `reference`."""
    for tuned in read_table(TABLE):
        assert 0.0 < tuned.probability < 1.0
        assert (tuned.episodes >= 50, tuned.first_seed >= 2000) == (True, True)
        assert 0.0 < tuned.aoi_sem < tuned.aoi_mean < 250.0
        assert tuned.version
        if tuned.preset == "reference" and tuned.policy in ("random-flooding", "mst"):
            assert tuned.probability in AUTHORS_GRID
        names = ("num_robots", "range_ratio", "velocity_ratio")
        its = {name: getattr(tuned, name) for name in names}
        mission = PRESETS[tuned.preset](tuned.task, num_windows=7, **its)
        assert tuned_probability(tuned.policy, mission) == tuned.probability


@pytest.mark.parametrize(
    ("num_robots", "expected"), [(10, 0.1), (27, 0.1), (29, 0.2), (80, 0.2), (200, 0.2)]
)
def test_nearest_is_by_ratio(monkeypatch, num_robots, expected):
    """Between 10 and 80 robots the border is sqrt(800) = 28.3, not 45."""
    rows = [row(0.1, num_robots=10), row(0.2, num_robots=80)]
    assert found(monkeypatch, rows, num_robots=num_robots) == expected


def test_nearest_weighs_all_ratios_alike(monkeypatch):
    """From 40 robots, range 0.5: twice the range is farther than 1.9 times the robots; 1.5 times
    both (0.164 + 0.164 in squared logarithms) is nearer than either (0.480, 0.412)."""
    range_off, size_off = row(0.1, range_ratio=1.0), row(0.2, num_robots=76, range_ratio=0.5)
    both_off = row(0.3, num_robots=60, range_ratio=0.75)
    assert found(monkeypatch, [range_off, size_off], range_ratio=0.5) == 0.2
    assert found(monkeypatch, [range_off, size_off, both_off], range_ratio=0.5) == 0.3


def test_velocity_counts_unless_the_team_stands_still(monkeypatch):
    fast, slow = {"velocity_ratio": 0.5}, {"velocity_ratio": 0.16}
    rows = [row(0.1, velocity_ratio=0.15), row(0.2, velocity_ratio=0.5)]
    assert found(monkeypatch, rows, **fast) == 0.2
    assert found(monkeypatch, rows, **slow) == 0.1
    still = [row(0.3, num_robots=39), row(0.4, velocity_ratio=0.5)]
    still = [replace(each, task="stationary") for each in still]
    assert found(monkeypatch, still, "stationary", **slow) == 0.4


def test_a_preset_or_task_or_policy_that_was_not_tuned_is_a_clear_error(monkeypatch):
    monkeypatch.setattr(tuning, "_table", lambda: [row(0.1)])
    for name, mission in [
        ("mst", paper("random-walk")),
        ("mst", reference("flocking")),
        ("gossip", paper("flocking")),
    ]:
        with pytest.raises(ValueError, match=rf"{name} has no tuned .* {mission.task}.*tune\.py"):
            tuned_probability(name, mission)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (HEADER.replace("preset", "mode") + ROW, "required field `preset`"),
        (HEADER + ROW.replace("40", "forty"), "Expected `int`, got `str` .*num_robots"),
    ],
)
def test_a_broken_table_is_a_clear_error(tmp_path, text, complaint):
    path = tmp_path / "tuned.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=complaint):
        read_table(path)


@pytest.mark.parametrize("preset", WORLDS)
@pytest.mark.parametrize("policy", POLICIES)
def test_worlds_take_what_was_tuned_for_the_papers_text(policy, preset):
    for task in ("stationary", "random-walk"):
        tuned = tuned_probability(policy, PRESETS[preset](task))
        assert tuned == tuned_probability(policy, paper(task))
