import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from swarm_mj.envs import register_environments
from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm

SMALL = {"num_robots": 5, "num_windows": 8, "range_ratio": 0.4}


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("Stationary", {}),
        ("RandomWalk", {"features": "paper", "with_parents": True}),
        ("Flocking", {"preset": "reference", "features": "reference"}),
    ],
)
@pytest.mark.usefixtures("opengl")
def test_gymnasiums_own_check(name, options):
    register_environments()
    env = gymnasium.make(f"swarm_mj/{name}-v0", **SMALL, **options)
    env.unwrapped.metadata = {**env.metadata, "render_modes": ["rgb_array"]}  # no window opens here
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_info_is_what_the_window_cost():
    env, swarm = SwarmEnv("random-walk", **SMALL), Swarm(paper("random-walk", **SMALL), [4])
    start = env.reset(seed=4)[1]
    assert start.pop("seed") == 4
    variance = np.var(swarm.states.velocity_mps[0], axis=0).sum()
    assert start.pop("velocity_variance_m2ps2") == pytest.approx(variance)
    assert not any(start.values())  # no age, no packets
    for recipient in np.random.default_rng(1).integers(0, 5, (8, 5)):
        *_, info = env.step(recipient)
        costs = swarm.step_with_recipients(recipient[None])
        expected = {
            "age_windows": costs.age_windows,
            "velocity_variance_m2ps2": costs.velocity_variance_m2ps2,
            "is_complete": costs.is_complete,
            "packets_sent": costs.packets.sent,
            "packets_delivered": costs.packets.delivered,
            "packets_lost": costs.packets.lost,
            "packets_overheard": costs.packets.overheard,
            "packets_answered": costs.packets.answered,
        }
        assert info == {"seed": 4} | {name: values[0] for name, values in expected.items()}


def test_parts_by_name_are_made_when_the_environment_is():
    register_environments()
    env = gymnasium.make("swarm_mj/Flocking-v0", channel="channels:to_nobody", **SMALL)
    env.reset(seed=1)
    assert env.step(np.array([1, 1, 2, 3, 4]))[4]["packets_lost"] == 1.0
    with pytest.raises(ValueError, match="there is no module nowhere"):
        gymnasium.make("swarm_mj/Flocking-v0", channel="nowhere:to_nobody")


def test_a_mission_may_be_given_whole_and_changed():
    register_environments()
    env = gymnasium.make("swarm_mj/Flocking-v0", mission=paper("stationary", **SMALL), num_robots=3)
    assert env.unwrapped.batch.mission == paper("stationary", **{**SMALL, "num_robots": 3})
