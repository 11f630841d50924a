"""What was measured of three small missions, by hand."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.measurements import Measurements
from swarm_mj.evaluation.samples import share_interval
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import paper
from swarm_mj.protocol.mission_costs import AOI, TASK_COST, VELOCITY_VARIANCE
from swarm_mj.simulation.components import Components

STATIONARY = paper("stationary", num_windows=4)
NONE = np.full(3, np.nan)


def costs(aoi, **overrides):
    """Three missions of 4 windows; what is not overridden is 0, or does not exist."""
    made_up = {
        "aoi": aoi,
        "aoi_steady": np.zeros(3),
        "aoi_floor": np.zeros(3),
        "velocity_variance": np.zeros(3),
        "hops": np.zeros(3),
        "task_cost": NONE,
        "task_cost_last": NONE,
        "complete_window": NONE,
        "agreed_window": NONE,
        "decay_rate": NONE,
        "strayed": np.zeros(3),
        "crashed": np.full(3, np.nan),
        "energy_j": np.full(3, np.nan),
        "most_energy_j": np.full(3, np.nan),
        "packets_sent": np.zeros(3),
        "packets_transmitted": np.zeros(3),
        "packets_delivered": NONE,
        "packets_heard": NONE,
        "packets_receptions": NONE,
        "ages": np.zeros(9, dtype=np.int64),
    }
    arrays = {name: np.asarray(each) for name, each in (made_up | overrides).items()}
    return BatchCosts(**arrays)


def measured(own, baseline=None, mission=STATIONARY, **study):
    """What `mst` cost beside `tdma`; without costs of that, `mst` is its own baseline."""
    compared_to = "mst" if baseline is None else "tdma"
    return Measurements(
        study=Study(
            policies=("mst", "tdma"), regimes=(mission,), episodes=3, baseline=compared_to, **study
        ),
        mission=mission,
        policy="mst",
        costs=own,
        baseline=compared_to,
        baseline_costs=own if baseline is None else baseline,
        version="1.2.3",
        commit=None,
    )


def test_costs_are_samples_of_their_own_arrays():
    found = measured(
        costs(
            [1.0, 2.0, 6.0],
            aoi_steady=[2.0, 4.0, 12.0],
            aoi_floor=[0.5, 1.0, 1.5],
            velocity_variance=[0.1, 0.2, 0.3],
            task_cost=[10.0, 20.0, 60.0],
            task_cost_last=[5.0, 5.0, 20.0],
        )
    )
    assert (found.aoi.mean, found.aoi.median, found.aoi.worst) == (3.0, 2.0, 6.0)
    assert found.aoi_steady.mean == 6.0
    assert found.aoi_floor.mean == 1.0
    assert found.velocity_variance.mean == pytest.approx(0.2)
    assert (found.task_cost.mean, found.task_cost_last.mean) == (30.0, 10.0)


def test_differences_are_mission_by_mission():
    """1 - 0, 2 - 3 and 6 - 1 are 1, -1 and 5."""
    own = costs([1.0, 2.0, 6.0], velocity_variance=[4.0, 4.0, 4.0])
    other = costs([0.0, 3.0, 1.0], velocity_variance=[1.0, 2.0, 3.0])
    found = measured(own, other)
    assert found.aoi_difference.values.tolist() == [1.0, -1.0, 5.0]
    assert found.velocity_variance_difference.values.tolist() == [3.0, 2.0, 1.0]
    assert found.task_cost_difference.values.size == 0  # there is no cost


def test_a_baseline_does_not_differ_from_itself():
    """Nothing, rather than differences of 0, which would say that it was compared."""
    found = measured(costs([1.0, 2.0, 6.0], task_cost=[1.0, 2.0, 3.0]))
    assert found.aoi_difference.values.size == 0
    assert found.task_cost_difference.values.size == 0


def test_ages_are_counted_in_slots_of_half_a_window():
    """Of 10 ages, 5 are of no slot, 4 of three and 1 of eight."""
    found = measured(costs([0.0] * 3, ages=np.array([5, 0, 0, 4, 0, 0, 0, 0, 1])))
    assert found.age_quantile(0.5) == 0.0
    assert found.age_quantile(0.9) == 1.5
    assert found.age_quantile(1.0) == 4.0


def test_packets_are_shared_out_among_all_that_were_sent():
    found = measured(
        costs(
            [0.0] * 3,
            packets_sent=[2.0, 3.0, 5.0],
            packets_transmitted=[3.0, 5.0, 7.0],
            packets_delivered=[1.0, 1.0, 3.0],
        )
    )
    assert (found.num_sent, found.num_windows) == (10.0, 12)
    assert found.per_packet(found.costs.packets_delivered) == 0.5
    assert math.isnan(found.per_packet(found.costs.packets_heard))  # of another kind
    # 15 packets, responses too, in 12 windows of 0.1 s.
    assert found.bytes_per_second == pytest.approx(found.packet_bytes * 15 / 1.2)


def test_no_share_of_no_packets():
    found = measured(costs([0.0] * 3, packets_delivered=np.zeros(3)))
    assert math.isnan(found.per_packet(found.costs.packets_delivered))


def test_a_mission_that_never_was_complete_is_later_than_any():
    windows = [3.0, math.nan, 2.0]
    found = measured(costs([0.0] * 3, complete_window=windows))
    assert found.complete.tolist() == [3.0, math.inf, 2.0]


FLOCKS = paper("flocking", num_windows=4)


def test_how_flocks_agree_is_measured_over_missions_that_did_not_too():
    windows = [3.0, math.nan, 2.0]
    own = costs(
        [0.0] * 3, agreed_window=windows, decay_rate=[0.1, math.nan, 0.2], strayed=[0.0, 2.0, 1.0]
    )
    found = measured(own, mission=FLOCKS)
    assert found.agreed_window_median == 3.0
    assert found.agreed_share == pytest.approx(2.0 / 3.0)
    assert found.agreed_share_interval == share_interval(np.array([True, False, True]))
    assert found.decay_rate.mean == pytest.approx(0.15)
    assert (found.strayed.mean, found.strayed.worst) == (1.0, 2.0)


def test_robots_that_do_not_flock_do_not_agree_either():
    found = measured(costs([0.0] * 3, agreed_window=[1.0] * 3, strayed=np.ones(3)))
    assert math.isnan(found.agreed_window_median)
    assert math.isnan(found.agreed_share)
    assert found.agreed_share_interval == (None, None)
    assert math.isnan(found.decay_rate.mean)
    assert math.isnan(found.strayed.mean)


def test_energy_is_the_mean_of_missions_and_the_most_of_any_robot():
    own = costs([0.0] * 3, energy_j=[10.0, 20.0, 60.0], most_energy_j=[15.0, 90.0, 70.0])
    found = measured(own, mission=paper("stationary", robot="quadrotor"))
    assert (found.energy_j.mean, found.most_energy_j.worst) == (30.0, 90.0)
    of_points = measured(costs([0.0] * 3))
    assert math.isnan(of_points.energy_j.mean)
    assert math.isnan(of_points.most_energy_j.worst)


def test_the_policy_and_its_options_are_those_of_the_study():
    found = measured(costs([0.0] * 3))
    assert found.probability == found.made.parameters["probability"] > 0.0
    assert replace(found, policy="tdma").probability is None  # it has none
    config = json.loads(found.config)
    assert (config["policy"], config["num_windows"]) == ("mst", 4)
    assert (found.task_cost_name, found.task_cost_unit) == (None, None)  # a team at rest
    assert found.component("channel") is None
    flock = measured(costs([0.0] * 3), mission=paper("flocking", num_windows=4))
    assert (flock.task_cost_name, flock.task_cost_unit) == ("velocity variance", "m²/s²")


def test_the_paper_reports_its_own_missions_only():
    """At 40 robots and range ratio 0.25 its MST has 43.3069, with a std of 9.7449 over 100."""
    found = measured(costs([0.0] * 3), mission=paper("stationary"))
    assert found.published_mean(AOI) == 43.3069
    assert found.published_sem(AOI) == pytest.approx(0.97449)
    assert found.published_mean(VELOCITY_VARIANCE) is found.published_sem(TASK_COST) is None
    assert measured(costs([0.0] * 3)).published_mean(AOI) is None  # of 4 windows


def test_the_paper_has_no_missions_with_a_users_own_parts():
    parts = Components(channel="channels:to_nobody")
    found = measured(costs([0.0] * 3), mission=paper("stationary"), components=parts)
    assert found.component("channel") == "channels:to_nobody"
    assert found.published_mean(AOI) is None
