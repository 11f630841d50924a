"""The radio alone: what it delivers is what the same missions' robots hear in a `Swarm`."""

import subprocess
import sys

import numpy as np
import pytest

import swarm_mj
from swarm_mj.mission import paper, reference
from swarm_mj.mission.presets import open_field
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

CHANNELS = {
    "free-space": paper("random-walk", num_robots=12, num_windows=30),
    "rayleigh": paper(
        "random-walk",
        num_robots=12,
        num_windows=30,
        fading="rayleigh",
        shadowing_db=6.0,
        erasure=0.2,
        burst_begin=0.1,
    ),
    "open-field": open_field(num_robots=12, num_windows=30),
    "authors": reference("stationary", num_robots=12, num_windows=30),
}


@pytest.mark.parametrize("name", CHANNELS)
@pytest.mark.parametrize("policy", ["random-flooding", "tdma"])
def test_deliveries_are_the_receptions_of_swarm(name, policy):
    """Slot by slot, from the positions and recipients of its missions."""
    mission, seeds = CHANNELS[name], [3, 4, 8]
    swarm, link = Swarm(mission, seeds), swarm_mj.Link(mission, seeds)
    num_heard = 0
    for _ in rollout(swarm, swarm_mj.make_policy(policy, mission)):
        for phase in swarm.phases:
            heard = link.deliver(swarm.states.position_m, phase.recipient)
            np.testing.assert_array_equal(heard, phase.heard)
            num_heard += np.sum(heard != np.arange(12))
    assert num_heard > 100


def test_robots_that_want_to_send_send_to_everyone():
    """By hand, range 250 m: 0 reaches 1 alone, and 2 sends out of reach of both."""
    link = swarm_mj.Link(paper("stationary", num_robots=4))
    position_m = np.array([[0.0, 0.0], [200.0, 0.0], [2000.0, 0.0], [2100.0, 0.0]])
    wants_to_send = np.array([True, False, True, False])
    assert link.deliver(position_m, wants_to_send).tolist() == [0, 0, 2, 2]
    assert link.deliver(position_m[None], wants_to_send[None]).tolist() == [[0, 0, 2, 2]]


def test_fades_differ_from_slot_to_slot_and_are_the_seeds():
    mission = paper("stationary", num_robots=20, fading="rayleigh")
    position_m = np.random.default_rng(0).uniform(-300.0, 300.0, (20, 2))
    wants_to_send = np.arange(20) < 3
    one, same, other = (swarm_mj.Link(mission, [seed]) for seed in (1, 1, 2))
    heard = [link.deliver(position_m, wants_to_send) for link in (one, same, other, one)]
    np.testing.assert_array_equal(heard[0], heard[1])
    assert np.any(heard[0] != heard[2])
    assert np.any(heard[0] != heard[3])


def test_what_cannot_be_delivered_is_refused():
    with pytest.raises(ValueError, match="arena must be open, not blocks"):
        swarm_mj.Link(paper("random-walk", arena="blocks"))
    with pytest.raises(ValueError, match="seeds must be"):
        swarm_mj.Link(paper(num_robots=3), [])
    link = swarm_mj.Link(paper(num_robots=3), [1, 2])
    with pytest.raises(ValueError, match=r"wants_to_send must have shape \(2, 3\)"):
        link.deliver(np.zeros((3, 2)), np.array([True, True, False]))
    silent = np.zeros((2, 3), dtype=bool)
    with pytest.raises(ValueError, match=r"of shape \(2, 3, 2\), not \(2, 2, 3\)"):
        link.deliver(np.zeros((2, 2, 3)), silent)
    with pytest.raises(ValueError, match="position_m must be finite"):
        link.deliver(np.full((2, 3, 2), np.nan), silent)


@pytest.mark.parametrize("kind", ["complex", "bool", "datetime64[s]", "timedelta64[s]", "str"])
def test_places_are_numbers(kind):
    """NumPy makes floats of all of these, of some without a word."""
    link = swarm_mj.Link(paper(num_robots=3))
    places = np.zeros((3, 2), dtype=int).astype(kind)
    with pytest.raises(ValueError, match=r"position_m must be numbers \[m\], not .*; convert them"):
        link.deliver(places, [True, False, False])


def test_who_sends_is_a_truth_or_an_addressee_of_each_robot():
    link = swarm_mj.Link(paper(num_robots=3))
    with pytest.raises(ValueError, match=r"wants_to_send must have shape \(1, 3\)"):
        link.deliver(np.zeros((3, 2)), True)
    with pytest.raises(ValueError, match="wants_to_send must be an array, or lists of the same"):
        link.deliver(np.zeros((3, 2)), [[True], [1, 2]])
    assert link.deliver(np.zeros((3, 2)), np.array([2, 1, 2], dtype=">i4")).tolist() == [0, 0, 0]


def test_a_link_needs_no_mujoco():
    code = (
        "import swarm_mj, sys; swarm_mj.Link(swarm_mj.paper()); sys.exit('mujoco' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
