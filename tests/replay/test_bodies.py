from dataclasses import replace

import numpy as np
import pytest
from reading import entities, rows

import swarm_mj
from swarm_mj import make_policy, paper
from swarm_mj.replay import layers
from swarm_mj.replay.bodies import rotated
from swarm_mj.replay.read import read_footage
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.write import RADIUS_SHARE, write_replay
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    """Quadrotors and a rover, whose flight was recorded, and the file."""
    run = swarm_mj.fly(
        "flocking", policy="tdma", robot="quadrotor:3,rover:1", num_robots=4, num_windows=12
    )
    path = tmp_path_factory.mktemp("replay") / "bodies.rrd"
    run.save(path)
    return run, path


def test_a_replay_keeps_heights_and_attitudes(replay):
    _, path = replay
    footage = read_footage(path)
    assert footage.position_m.shape == (12, 4, 2)
    np.testing.assert_allclose(footage.height_m[:, :3], 20.0, atol=0.1)
    np.testing.assert_allclose(footage.height_m[:, 3], 0.125, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(footage.attitude, axis=2), 1.0, atol=1e-5)
    assert np.max(np.abs(footage.attitude[:, :3, 1:])) > 0.01  # they tilted
    assert np.all(footage.attitude[:, 3, 1:3] == 0.0)  # the rover did not


def test_packets_lead_from_height_to_height(replay):
    run, path = replay
    packets = read_footage(path).packets
    num_packets = 0
    for fate, flown in run.footage().packets.items():
        np.testing.assert_allclose(packets[fate].start_m, flown.start_m, atol=1e-3)
        np.testing.assert_allclose(packets[fate].end_m, flown.end_m, atol=1e-3)
        num_packets += len(flown.row)
    assert num_packets > 0


def test_points_have_neither(tmp_path):
    run = swarm_mj.fly("flocking", policy="tdma", num_robots=3, num_windows=3)
    path = tmp_path / "points.rrd"
    run.save(path)
    footage = read_footage(path)
    assert footage.height_m is None
    assert footage.attitude is None


def test_a_wind_is_an_arrow_as_long_as_it_is_strong(tmp_path):
    """A mean of 6 m/s to the east, and gusts of 2 m/s: strong is 10 m/s, 0.15 of half the map."""
    how = {"robot": "quadrotor", "num_robots": 3, "num_windows": 6, "range_ratio": 2.0}
    swarm = Swarm(paper("random-walk", wind_mps=6.0, gust_mps=2.0, **how), [1])
    recorder = Recorder(swarm)
    flown_mps = []
    for window in rollout(swarm, make_policy("tdma", swarm.mission)):
        recorder.add(window)
        flown_mps.append(swarm.states.wind_mps[0])
    log = recorder.log()
    np.testing.assert_array_equal(log.wind_mps, flown_mps)
    assert np.ptp(log.wind_mps[:, 0]) > 0.1
    assert np.mean(log.wind_mps[:, 0]) > 2.0
    path = tmp_path / "windy.rrd"
    write_replay(log, {"seed": 1}, path)
    vectors_m = rows(path, f"/{layers.WIND.path}", "Arrows2D:vectors", 2)
    expected_m = 0.15 * swarm.mission.half_side_m / 10.0 * log.wind_mps
    np.testing.assert_allclose(vectors_m, expected_m, rtol=1e-5)


def test_in_calm_there_is_no_arrow(replay):
    run, path = replay
    assert not run.mission.has_wind
    assert f"/{layers.WIND.path}" not in entities(path)


def test_thrust_is_a_line_as_long_as_the_weight_of_what_hovers(tmp_path):
    """Straight up by 4 radii of a disc; the rover at rest pushes nowhere."""
    mission = paper("stationary", robot="quadrotor:2,rover:1", num_robots=3, range_ratio=2.0)
    swarm = Swarm(replace(mission, num_windows=4), [1])
    recorder = Recorder(swarm)
    for window in rollout(swarm, make_policy("tdma", swarm.mission)):
        recorder.add(window)
    path = tmp_path / "hovering.rrd"
    write_replay(recorder.log(), {"seed": 1}, path)
    lines_m = rows(path, f"/{layers.SCENE_THRUST.path}", "LineStrips3D:strips", 3, 2, 3)
    way_m = lines_m[:, :, 1] - lines_m[:, :, 0]
    np.testing.assert_allclose(way_m[..., :2], 0.0, atol=1e-3)
    length_m = 4.0 * RADIUS_SHARE * mission.half_side_m
    np.testing.assert_allclose(way_m[..., 2], [[length_m, length_m, 0.0]] * 4, rtol=1e-3, atol=1e-3)


def test_thrust_turns_with_its_robot():
    """Rolled by 90 degrees about x, what pushed up pushes to the right, which is -y."""
    half = np.sqrt(0.5)
    attitude = np.array([[[half, half, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]])
    up = np.array([[[0.0, 0.0, 1.0], [0.3, 0.0, 2.0]]])
    np.testing.assert_allclose(
        rotated(up, attitude)[0], [[0.0, -1.0, 0.0], [0.3, 0.0, 2.0]], atol=1e-12
    )
