"""Laws of the whole simulation: the names of robots do not matter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from turns import settled

from swarm_mj.control.motion import flocking
from swarm_mj.mission import paper, reference
from swarm_mj.mission.geometry import spanning_tree
from swarm_mj.physics.state import RobotStates
from swarm_mj.physics.worlds import PointWorlds
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.costs import mean_hops, window_costs
from swarm_mj.protocol.window import window
from swarm_mj.radio.mission_radio import radio_of

NUM_ROBOTS, NUM_WINDOWS = 9, 6


def talked(mission, states, recipients):
    """Buffers, the last window's costs, hops and accelerations after some windows."""
    buffers, channel = empty_buffers(1, NUM_ROBOTS), radio_of(mission)
    for now, recipient in enumerate(recipients):
        turn = settled(states, recipient[None])
        phases = window(buffers, *turn, channel, np.array([float(now)]))
    costs = window_costs(
        buffers, states, phases, np.array([float(len(recipients))]), is_broadcast=False
    )
    wanted = flocking(buffers, states.velocity_mps, mission.flocking_set)
    return buffers, costs, mean_hops(buffers), wanted


@pytest.mark.parametrize("preset", [paper, reference])
@given(seed=st.integers(0, 2**32 - 1))
def test_renaming_the_robots_renames_everything(preset, seed):
    """Robot i of the renamed team is robot name[i] of the other one."""
    rng = np.random.default_rng(seed)
    mission = preset("flocking", num_robots=NUM_ROBOTS)
    states = RobotStates(
        position_m=rng.uniform(-200.0, 200.0, (1, NUM_ROBOTS, 2)),
        velocity_mps=rng.uniform(-3.0, 3.0, (1, NUM_ROBOTS, 2)),
    )
    is_sent = rng.random((NUM_WINDOWS, NUM_ROBOTS)) < 0.2
    anyone = rng.integers(0, NUM_ROBOTS, (NUM_WINDOWS, NUM_ROBOTS))
    recipients = np.where(is_sent, anyone, np.arange(NUM_ROBOTS))
    name = rng.permutation(NUM_ROBOTS)
    new_name = np.argsort(name)
    renamed_bodies = RobotStates(
        position_m=states.position_m[:, name], velocity_mps=states.velocity_mps[:, name]
    )

    buffers, costs, hops, wanted = talked(mission, states, recipients)
    renamed, same_costs, same_hops, renamed_wanted = talked(
        mission, renamed_bodies, new_name[recipients[:, name]]
    )

    pairs = np.ix_([0], name, name)
    for field in ("timestamp", "position_m", "velocity_mps", "last_attempt"):
        np.testing.assert_array_equal(
            getattr(renamed, field), getattr(buffers, field)[pairs], err_msg=field
        )
    old_parent = buffers.parent[pairs]
    expected = np.where(old_parent < 0, old_parent, new_name[old_parent])
    np.testing.assert_array_equal(renamed.parent, expected)
    np.testing.assert_array_equal(same_hops, hops)
    np.testing.assert_allclose(renamed_wanted, wanted[:, name], atol=1e-12)
    np.testing.assert_array_equal(same_costs.age_windows, costs.age_windows)
    np.testing.assert_allclose(
        same_costs.velocity_variance_m2ps2, costs.velocity_variance_m2ps2, rtol=1e-12
    )
    for fate in ("attempted", "delivered", "lost", "overheard", "answered"):
        np.testing.assert_array_equal(
            getattr(same_costs.packets, fate), getattr(costs.packets, fate), err_msg=fate
        )


@pytest.mark.parametrize("physics", ["exact", "contact"])
def test_renaming_the_robots_renames_their_motion(physics):
    rng = np.random.default_rng(1)
    mission = paper("random-walk", num_robots=NUM_ROBOTS, physics=physics, velocity_ratio=1.0)
    position_m = rng.uniform(-200.0, 200.0, (1, NUM_ROBOTS, 2))
    velocity_mps = rng.uniform(-20.0, 20.0, (1, NUM_ROBOTS, 2))
    name = rng.permutation(NUM_ROBOTS)
    one, other = PointWorlds(mission, 1), PointWorlds(mission, 1)
    one.place(position_m, velocity_mps)
    other.place(position_m[:, name], velocity_mps[:, name])
    for _ in range(100):
        acceleration = rng.normal(0.0, 7.0, (1, NUM_ROBOTS, 2))
        states, renamed = one.step(acceleration), other.step(acceleration[:, name])
    np.testing.assert_allclose(renamed.position_m, states.position_m[:, name], atol=1e-9)
    np.testing.assert_allclose(renamed.velocity_mps, states.velocity_mps[:, name], atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1))
def test_renaming_the_robots_keeps_the_spanning_tree_s_edges(seed):
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-200.0, 200.0, (1, NUM_ROBOTS, 2))
    name = rng.permutation(NUM_ROBOTS)

    def edges(parent, called):
        return {frozenset((called[i], called[j])) for i, j in enumerate(parent) if j >= 0}

    tree, renamed = spanning_tree(position_m)[0], spanning_tree(position_m[:, name])[0]
    assert edges(renamed, name) == edges(tree, np.arange(NUM_ROBOTS))
