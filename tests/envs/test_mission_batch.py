"""What every face is made of: rewards by hand, masks, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from channels import to_nobody

from swarm_mj.envs.options import make_batch, robot_spaces
from swarm_mj.mission import paper, reference
from swarm_mj.policies.gnn.feature_sets import FEATURE_SETS, make_extractor
from swarm_mj.simulation.swarm import Swarm

SMALL = {"num_robots": 5, "num_windows": 10, "range_ratio": 0.4}


def begun(*args, seeds=(1, 2), **options):
    batch = make_batch(*args, len(seeds), **{**SMALL, **options})
    batch.restart(seeds)
    return batch


def recipients(num_windows, num_missions=2, num_robots=5):
    return np.random.default_rng(5).integers(0, num_robots, (num_windows, num_missions, num_robots))


def test_eq10_eq17_rewards_are_minus_the_mean_age_and_the_variance_of_velocities():
    walks, flocks = begun("random-walk"), begun("flocking", reward="velocity-variance")
    for now, recipient in enumerate(recipients(10), start=1):
        of_age, of_variance = walks.step(recipient), flocks.step(recipient)
        for b in range(2):
            ages = [now - t for row in walks.swarm.buffers.timestamp[b] for t in row]
            assert of_age[b] == pytest.approx([-sum(ages) / 25] * 5, rel=1e-14)
            velocity = flocks.swarm.states.velocity_mps[b]
            squares = [(each - each.mean()) ** 2 for each in velocity.T]
            assert of_variance[b] == pytest.approx([-np.sum(squares) / 5] * 5, rel=1e-12)


@pytest.mark.parametrize(("num_robots", "num_windows"), [(10, 500), (5, 100)])
def test_a_silent_team_scores_what_the_docs_say(num_robots, num_windows):
    batch = begun("stationary", num_robots=num_robots, num_windows=num_windows)
    silence = np.tile(np.arange(num_robots), (2, 1))
    rewards = [batch.step(silence) for _ in range(num_windows)]
    score = -(1 - 1 / num_robots) * (num_windows + 1) / 2
    assert np.mean(rewards, axis=(0, 2)) == pytest.approx([score] * 2, rel=1e-12)
    page = Path(__file__).parents[2] / "docs" / "environments.md"
    text = " ".join(page.read_text(encoding="utf-8").split())
    assert f"{score:g} for {num_robots} robots and {num_windows} windows" in text


@pytest.mark.parametrize("controller", [None, "added_tasks:Coverage"])
def test_task_cost_is_what_the_controller_says(controller):
    batch = begun("flocking", reward="task-cost", controller=controller)
    swarm = Swarm(batch.mission, [1, 2], controller=controller)
    start = batch.infos()["task_cost"]
    np.testing.assert_array_equal(start, swarm.controller.cost(swarm.states))
    for recipient in recipients(5):
        reward, costs = batch.step(recipient), swarm.step_with_recipients(recipient)
        np.testing.assert_array_equal(reward, np.tile(-costs.task_cost.value[:, None], 5))
        np.testing.assert_array_equal(batch.infos()["task_cost"], costs.task_cost.value)
    assert not np.array_equal(batch.infos()["task_cost"], start)
    assert "task_cost" not in begun("stationary").infos()


def test_what_is_seen_is_what_the_networks_see():
    sparse = {"num_robots": 8, "num_windows": 60, "range_ratio": 0.15}
    batch = begun("stationary", with_parents=True, seeds=(1, 2, 3), **sparse)
    extractor = make_extractor("extended", batch.mission)
    extractor.start(3, 8)
    for recipient in recipients(60, 3, 8):
        batch.step(recipient)
        graphs, seen = extractor.graphs(batch.swarm.views), batch.observation
        np.testing.assert_array_equal(seen["observation"].reshape(graphs.node.shape), graphs.node)
        np.testing.assert_array_equal(seen["parent"].reshape(24, 8), graphs.parent)
        np.testing.assert_array_equal(seen["action_mask"].reshape(24, 8) == 1, graphs.may_address)
    assert not np.all(seen["action_mask"])  # some teammates are believed out of range


def test_a_robot_that_failed_may_only_be_silent():
    batch = begun("flocking", failure_fraction=0.4)
    for recipient in recipients(6):
        batch.step(recipient)
    failed = ~batch.is_active
    assert np.all(failed.sum(axis=1) == 2)
    masks = batch.observation["action_mask"]
    np.testing.assert_array_equal(masks[failed], np.broadcast_to(np.eye(5), masks.shape)[failed])
    assert masks[~failed].sum() > 6


def test_a_custom_channel_is_used_and_left_alone():
    class Counting:
        calls = 0

        def __call__(self, position_m, recipient):
            self.calls += 1
            return to_nobody(position_m, recipient)

    mission = paper("stationary", **SMALL)
    mine = Counting()
    batch = make_batch(mission, channel=mine)
    batch.restart([1])
    batch.step(np.array([[1, 2, 3, 4, 0]]))
    assert batch.infos()["packets_lost"] == [5]
    assert (batch.swarm.channel.calls, mine.calls) == (2, 0)


@pytest.mark.parametrize("features", FEATURE_SETS)
@pytest.mark.parametrize(
    "mission",
    [
        paper("flocking", num_windows=40),
        reference("random-walk", num_windows=40, window_s=10.0, velocity_ratio=5.0),
        paper("flocking", num_windows=40, window_s=10.0, velocity_ratio=5.0, density_per_km2=1e4),
    ],
)
def test_no_feature_leaves_its_bounds(mission, features):
    batch = make_batch(replace(mission, num_robots=4), 2, features=features)
    seen, _ = robot_spaces(batch)
    batch.restart([1, 2])
    for recipient in recipients(40, 2, 4):
        batch.step(recipient)
        most = np.abs(batch.observation["observation"]).max()
        assert most <= seen["observation"].high.max()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"reward": "age"},
            "reward must be one of aoi, velocity-variance, task-cost, credit, not 'age'",
        ),
        ({"reward": "credit", "bit_rate": 5000.0}, "reward credit requires unfragmented packets"),
        ({"mission": "stationary", "reward": "task-cost"}, "stationary has none; choose"),
        ({"features": "mine"}, "features must be one of"),
        ({"preset": "mine"}, "preset must be one of"),
        ({"num_robots": 1}, "number of robots must be"),
        ({"num_missions": 0}, "number of missions must be 1 or more, not 0"),
        ({"mission": paper(), "preset": "reference"}, "preset reference goes with a task's name"),
        ({"channel": "channels:lost"}, r"channels.py has no lost"),
        ({"scene": "wall"}, "must be named module:Name"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(ValueError, match=message):
        make_batch(**options)


def test_nothing_flies_before_it_has_begun_and_after_the_last_window():
    batch = begun("stationary")
    with pytest.raises(ValueError, match="call reset"):
        make_batch().step(np.zeros((1, 40), dtype=int))
    for recipient in recipients(10):
        batch.step(recipient)
    with pytest.raises(ValueError, match=r"over after its 10 windows; call reset\(\)"):
        batch.step(recipient)
    assert batch.flown.now[0] == 10.0
    batch.restart([1, 2])
    batch.step(recipient)
