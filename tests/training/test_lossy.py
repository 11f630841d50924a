"""The channel of the recipe loses 30 % of what the mission's radio delivers, and nothing else."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.radio.mission_radio import radio_of
from training.examples.lossy import LOST, Lossy

MISSION = paper("stationary", num_robots=20)


def test_packets_are_lost_at_its_rate_and_no_others_arrive():
    rng = np.random.default_rng(1)
    channel = Lossy(MISSION)
    channel.start(20, [np.random.default_rng(2)])
    nobody = np.arange(20)
    num_delivered = num_lost = 0
    for _ in range(400):
        position_m = rng.uniform(-300.0, 300.0, (1, 20, 2))
        recipient = np.where(rng.random((1, 20)) < 0.1, -1, nobody[None])
        delivered = radio_of(MISSION)(position_m, recipient)
        heard = channel(position_m, recipient)
        is_lost = heard != delivered
        assert (heard[is_lost] == np.broadcast_to(nobody, heard.shape)[is_lost]).all()
        num_delivered += int((delivered != nobody).sum())
        num_lost += int(is_lost.sum())
    assert num_delivered > 2000
    assert num_lost / num_delivered == pytest.approx(LOST, abs=0.04)
