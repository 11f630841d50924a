import numpy as np
import pytest

import swarm_mj
from swarm_mj.replay.read import read_footage


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
