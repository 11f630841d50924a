"""Results of made-up batches, against hand arithmetic and scipy."""

import json
import math
from dataclasses import asdict, replace

import numpy as np
import pytest
import scipy.stats

from swarm_mj.evaluation import study as study_module
from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.results import COLUMNS, CONVERGENCE
from swarm_mj.evaluation.study import Study
from swarm_mj.evaluation.summary import study_results, write_evaluated
from swarm_mj.mission import paper, reference

STATIONARY = reference("stationary")
FLOCK = paper("flocking", num_robots=5)


@pytest.fixture(autouse=True)
def _batches_of_two(monkeypatch):
    monkeypatch.setattr(study_module, "BATCH_SIZE", 2)


def costs(aoi, **overrides):
    """Missions of 500 windows: 1000 ages of 0, and what else is overridden."""
    n = len(aoi)
    made_up = {
        "aoi": aoi,
        "aoi_steady": [age - 0.5 for age in aoi],
        "aoi_floor": [age / 4.0 for age in aoi],
        "velocity_variance": [age / 10.0 for age in aoi],
        "hops": [1.0] * n,
        "task_cost": [None] * n,
        "task_cost_last": [None] * n,
        "complete_window": [None] * n,
        "agreed_window": [None] * n,
        "decay_rate": [None] * n,
        "strayed": [0.0] * n,
        "crashed": [None] * n,
        "energy_j": [None] * n,
        "most_energy_j": [None] * n,
        "packets_sent": [1000] * n,
        "packets_transmitted": [1500] * n,
        "packets_delivered": [250] * n,
        "packets_heard": [None] * n,
        "packets_receptions": [None] * n,
        "ages": [1000] + [0] * 1000,
    }
    arrays = {name: np.array(each, float) for name, each in (made_up | overrides).items()}
    return BatchCosts(**arrays | {"ages": arrays["ages"].astype(int)})


def two_policies(regime=STATIONARY, **overrides):
    policies = ("mst", "round-robin")
    return Study(policies=policies, regimes=(regime,), episodes=3, seed=5, **overrides)


MST = [
    costs(
        [40.0, 46.0],
        complete_window=[30, None],
        hops=[2.0, 3.0],
        ages=[95] + [0] * 300 + [5] + [0] * 699,
    ),
    costs([43.0], complete_window=[40], hops=[4.0], ages=[5] + [0] * 9 + [5] + [0] * 990),
]
ROUND_ROBIN = [
    costs([41.0, 48.0], packets_sent=[0, 0], packets_delivered=[0, 0]),
    costs([49.0], packets_sent=[0], packets_delivered=[0]),
]


NO_PACKETS = {f"packets_{name}": [0] for name in ("sent", "heard", "receptions")}
SILENT = costs([1.0], packets_delivered=[None], **NO_PACKETS)
MADE_BY = {"version": "1.2.3", "commit": "abc"}


def evaluated(study=None, batches=(*MST, *ROUND_ROBIN)):
    return study_results(study or two_policies(), dict(enumerate(batches)), MADE_BY)


def results(*given):
    return [each.result for each in evaluated(*given)]


def with_task_costs():
    """A tenth of the age in metres, at the end a twentieth."""
    return [
        replace(batch, task_cost=batch.aoi / 10.0, task_cost_last=batch.aoi / 20.0)
        for batch in (*MST, *ROUND_ROBIN)
    ]


BY_HAND = {
    # 40, 43, 46: the mean's distances are 3, 0, 3; 18 / 2 = 9 is the variance.
    "aoi_mean": 43.0,
    "aoi_std": 3.0,
    "aoi_sem": 3.0 / math.sqrt(3.0),
    "aoi_median": 43.0,
    "aoi_p95": 43.0 + 0.9 * 3.0,
    "aoi_worst": 46.0,
    "aoi_steady_mean": 42.5,
    "aoi_floor_mean": 43.0 / 4.0,
    "aoi_floor_sem": 3.0 / 4.0 / math.sqrt(3.0),
    # 110 ages: 95 and 5 of 0, five of 10 half windows, five of 301. 95 % are the first 104.5.
    "age_p95": 5.0,
    "age_worst": 150.5,
    "velocity_variance_mean": 4.3,
    "velocity_variance_std": 0.3,
    "velocity_variance_sem": 0.3 / math.sqrt(3.0),
    "velocity_variance_median": 4.3,
    "delivery_ratio": 0.25,
    "packets_per_window": 2.0,
    "hops_mean": 3.0,
    "complete_window_median": 40.0,
    "complete_share": 2 / 3,
    # 1500 packets of 367 bytes, responses too, in missions of 500 windows of 0.1 s.
    "packet_bytes": 367,
    "bytes_per_second": 1500 * 367 / 50.0,
    "published_aoi_mean": 43.3069,
    "published_aoi_sem": 0.97449,
}
NONE = ("heard_ratio", "hearers_per_packet", "task_cost_name", "task_cost_mean", "task_cost_sem")


def test_costs_by_hand():
    mst, round_robin = results()
    assert {name: getattr(mst, name) for name in BY_HAND} == pytest.approx(BY_HAND)
    assert {getattr(mst, name) for name in NONE} == {None}
    assert mst.aoi_ci_low < 43.0 < mst.aoi_ci_high
    assert mst.velocity_variance_ci_low < 4.3 < mst.velocity_variance_ci_high
    assert (round_robin.delivery_ratio, round_robin.packets_per_window) == (None, 0.0)
    assert (round_robin.complete_window_median, round_robin.complete_share) == (None, 0.0)


def test_broadcasts_by_hand():
    """1500 packets, 600 of them heard, 2400 times; nothing is delivered to anyone."""
    broadcast = costs(
        [40.0, 46.0, 43.0],
        packets_sent=[1000, 200, 300],
        packets_delivered=[None] * 3,
        packets_heard=[500, 0, 100],
        packets_receptions=[1000, 0, 1400],
    )
    study = Study(policies=("planner",), regimes=(STATIONARY,), episodes=3, seed=5)
    (planner,) = results(study, (broadcast, SILENT))
    assert planner.packets_per_window == pytest.approx(1500 / (4 * 500))
    assert (planner.heard_ratio, planner.hearers_per_packet) == (0.4, 1.6)
    assert planner.delivery_ratio is None
    assert planner.payload == "links"


def test_differences_are_paired():
    """49 - 43, 48 - 46, 41 - 40 are 6, 2, 1: their spread is not that of the ages."""
    mst, round_robin = results()
    assert mst.baseline == round_robin.baseline == "mst"
    assert round_robin.aoi_difference_mean == pytest.approx(3.0)
    assert round_robin.velocity_variance_difference_mean == pytest.approx(0.3)
    interval = scipy.stats.bootstrap(
        ([1.0, 2.0, 6.0],), np.mean, rng=np.random.default_rng(1)
    ).confidence_interval
    assert round_robin.aoi_difference_ci_low == pytest.approx(interval.low, abs=0.4)
    assert round_robin.aoi_difference_ci_high == pytest.approx(interval.high, abs=0.4)
    for cost in ("aoi", "velocity_variance"):
        for figure in ("mean", "ci_low", "ci_high"):
            assert getattr(mst, f"{cost}_difference_{figure}") is None


def test_a_named_baseline_and_a_flocks_published_variance():
    flocks = paper("flocking", velocity_ratio=0.5)
    mst, round_robin = results(two_policies(flocks, baseline="round-robin"))
    assert mst.aoi_difference_mean == pytest.approx(-3.0)
    assert round_robin.aoi_difference_mean is None
    assert mst.published_velocity_variance_mean == 1.9393
    assert mst.published_velocity_variance_sem == pytest.approx(0.08339)


def test_the_regime_and_the_origin_stand_beside():
    mst, round_robin = results()
    config = json.loads(mst.config)
    assert (mst.policy, mst.task, mst.preset) == ("mst", "stationary", "reference")
    assert (mst.num_robots, mst.num_windows, mst.boundary) == (40, 500, "reflect")
    assert (mst.episodes, mst.seed, mst.payload) == (3, 5, "none")
    assert (mst.version, mst.commit) == ("1.2.3", "abc")
    assert mst.published_velocity_variance_mean is round_robin.probability is None
    assert config["policy"] == "mst"
    assert config["probability"] == mst.probability
    assert config["max_acceleration_mps2"] == 10.0


def test_one_mission_over_a_custom_channel_has_no_errors_no_floor_and_a_difference():
    study = replace(two_policies(), episodes=1)
    mst, round_robin = results(study, (costs([4.0], aoi_floor=[None]), costs([6.0])))
    for name in ("std", "sem", "ci_low", "ci_high", "steady_sem", "floor_sem", "floor_mean"):
        assert getattr(mst, f"aoi_{name}") is None
    assert (mst.aoi_mean, mst.aoi_median, mst.aoi_p95, mst.aoi_worst) == (4.0,) * 4
    assert round_robin.aoi_difference_mean == 2.0
    assert round_robin.aoi_difference_ci_low is None


def test_missions_come_in_the_order_of_their_seeds_whatever_was_done_first():
    backwards = dict(reversed(list(enumerate([*MST, *ROUND_ROBIN]))))
    assert study_results(two_policies(), backwards, MADE_BY) == evaluated()
    assert evaluated()[0].aoi == [40.0, 46.0, 43.0]
    assert evaluated()[1].velocity_variance == pytest.approx([4.1, 4.8, 4.9])


def test_a_tasks_cost_is_named_and_compared():
    mst, round_robin = results(two_policies(FLOCK), with_task_costs())
    assert (mst.task_cost_name, mst.task_cost_unit) == ("velocity variance", "m²/s²")
    assert mst.task_cost_mean == pytest.approx((4.0 + 4.6 + 4.3) / 3)
    assert mst.task_cost_last_mean == pytest.approx(4.3 / 2)
    assert mst.task_cost_sem == pytest.approx(0.3 / 3**0.5)
    assert round_robin.task_cost_difference_mean == pytest.approx((0.1 + 0.2 + 0.6) / 3)
    assert mst.published_aoi_mean is None


def test_json_has_the_columns_with_each_missions_costs(tmp_path):
    found = evaluated(two_policies(FLOCK), with_task_costs())
    write_evaluated(tmp_path / "r.json", found)
    first, second = json.loads((tmp_path / "r.json").read_text())["results"]
    costs_of = ["episode_aoi", "episode_velocity_variance", "episode_task_cost"]
    of_flocks = [f"episode_{name}" for name in CONVERGENCE]
    assert list(first) == [*COLUMNS, *costs_of, *of_flocks]
    assert first["episode_agreed_window"] == [None] * 3
    assert first["episode_strayed"] == [0.0] * 3
    assert first["episode_aoi"] == [40.0, 46.0, 43.0]
    assert second["episode_task_cost"] == pytest.approx([4.1, 4.8, 4.9])
    assert {name: second[name] for name in COLUMNS} == asdict(found[1].result)
    (tmp_path / "r.json").unlink()
    assert not {"episode_task_cost", *of_flocks} & evaluated()[0].row.keys()
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_evaluated(tmp_path / "r.json", [replace(found[0], aoi=[math.nan])])
    assert not list(tmp_path.iterdir())
