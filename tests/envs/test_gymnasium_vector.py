"""The vector environment against Gymnasium's own, `SyncVectorEnv` over single environments."""

import copy

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from scanners import SCANNERS

from swarm_mj.envs import register_environments
from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv

SMALL = {"num_robots": 5, "num_windows": 6, "range_ratio": 0.4}
NUM_ENVS = 3
EVERY_MODE = pytest.mark.parametrize("mode", list(AutoresetMode))


def both(mode, **options):
    options = {**SMALL, **options}
    ours = SwarmVectorEnv(NUM_ENVS, "random-walk", autoreset_mode=mode, **options)
    makes = [lambda: SwarmEnv("random-walk", **options)] * NUM_ENVS
    return ours, SyncVectorEnv(makes, autoreset_mode=mode)


def same(ours, theirs):
    assert data_equivalence(ours, theirs, exact=True), (ours, theirs)


def actions(num_steps):
    rng = np.random.default_rng(3)
    return rng.integers(0, SMALL["num_robots"], (num_steps, NUM_ENVS, SMALL["num_robots"]))


def begin_what_is_over(envs, step):
    """What a user does whose environments do not begin anew by themselves."""
    ours, theirs = envs
    if step is not None and ours.metadata["autoreset_mode"] == AutoresetMode.DISABLED:
        is_over = step[2] | step[3]
        if is_over.any():
            same(*(env.reset(options={"reset_mask": is_over.copy()}) for env in (ours, theirs)))


@EVERY_MODE
def test_equals_gymnasiums_vector_of_single_environments(mode):
    envs = both(mode)
    ours, theirs = envs
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.single_observation_space == theirs.single_observation_space
    assert ours.single_action_space == theirs.single_action_space
    begun = ours.reset(seed=4)
    same(begun, theirs.reset(seed=4))
    held, num_ended, step = copy.deepcopy(begun), 0, None
    for action in actions(20):
        begin_what_is_over(envs, step)
        step = ours.step(action)
        same(step, theirs.step(action))
        num_ended += step[3].sum()
    assert num_ended >= 2 * NUM_ENVS
    same(begun, held)  # observations are the user's own


@EVERY_MODE
def test_reset_mask_begins_some_and_leaves_the_others(mode):
    envs = both(mode)
    ours, theirs = envs
    same(ours.reset(seed=[7, 8, 9]), theirs.reset(seed=[7, 8, 9]))
    step, num_alone, shown = None, 0, []
    # The last two overlap: who leaves a batch of two must not take it along.
    masks = {2: [True, False, False], 4: [True, True, False], 5: [True, False, True]}
    for t, action in enumerate(actions(30)):
        begin_what_is_over(envs, step)
        if t in masks:
            options = [{"reset_mask": np.array(masks[t])} for _ in envs]
            seeds = [t, None, 20]
            same(
                ours.reset(seed=seeds, options=options[0]),
                theirs.reset(seed=seeds, options=options[1]),
            )
            assert "reset_mask" in options[0]  # it is the user's
        step = ours.step(action)
        same(step, theirs.step(action))
        if mode == AutoresetMode.DISABLED:  # a user's own writing is not shown again
            step[0]["observation"][...] = 7.0
        shown.append((step[0], copy.deepcopy(step[0])))
        num_alone += step[3].sum() == 1
    assert num_alone > 2  # they ended at different times
    for observation, held in shown:  # nor are a user's arrays written later
        same(observation, held)


def test_made_by_name():
    register_environments()
    env = gymnasium.make_vec(
        "swarm_mj/Flocking-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
        **SMALL,
    )
    assert isinstance(env, SwarmVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert env.autoreset_mode is AutoresetMode.SAME_STEP  # where TorchRL looks for it
    assert (env.num_envs, env.single_action_space.shape) == (2, (5,))
    default = gymnasium.make_vec("swarm_mj/Flocking-v0").metadata["autoreset_mode"]
    assert default is AutoresetMode.NEXT_STEP


def test_without_autoreset_an_ended_mission_is_refused():
    env = SwarmVectorEnv(NUM_ENVS, autoreset_mode=AutoresetMode.DISABLED, **SMALL)
    env.reset(seed=0)
    *flown, late = actions(7)
    for action in flown:
        env.step(action)
    with pytest.raises(ValueError, match=r"environment 0 is over.*reset_mask"):
        env.step(late)


@pytest.mark.parametrize(
    ("seed", "options", "message"),
    [
        ([1, 2], {}, "seed must be one number, or 3"),
        (True, {}, r"seeds must be .* integers from 0 to .*, not \[True, 2, 3\]"),
        (None, {"reset_mask": [True, True]}, "reset_mask must be 3 bools"),
        (None, {"reset_mask": np.zeros(3, dtype=bool)}, "not all False"),
        (None, {"reset_mask": np.ones(3)}, "reset_mask must be 3 bools"),
    ],
)
def test_refused_resets(seed, options, message):
    env = SwarmVectorEnv(NUM_ENVS, **SMALL)
    with pytest.raises(ValueError, match=message):
        env.reset(seed=seed, options=options)


def test_refused_actions():
    env = SwarmVectorEnv(NUM_ENVS, **SMALL)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"shape \(3, 5\).* not \(5,\)"):
        env.step(np.zeros(5, dtype=int))
    with pytest.raises(ValueError, match="from 0 to 4, not 5"):
        env.step(np.full((3, 5), 5))
    with pytest.raises(ValueError, match="whose agents are robots"):
        SwarmVectorEnv(2, reward="credit")


def test_nothing_moves_unless_all_actions_are_robots():
    """Batches are flown one by one: those before the bad one had moved a window."""
    env = SwarmVectorEnv(NUM_ENVS, **SMALL)
    env.reset(seed=0)
    env.reset(seed=4, options={"reset_mask": np.array([False, True, False])})
    bad = np.zeros((NUM_ENVS, 5), dtype=int)
    bad[1, 0] = 99
    with pytest.raises(ValueError, match="action of robot 0 in mission 1 must be from 0 to 4"):
        env.step(bad)
    assert [batch.flown.now[0] for batch in env._batches] == [0.0] * NUM_ENVS
    env.step(np.zeros((NUM_ENVS, 5), dtype=">i2"))
    assert [batch.flown.now[0] for batch in env._batches] == [1.0] * NUM_ENVS


OWN = """
from dataclasses import replace
from swarm_mj.policies.gnn.graphs import PaperFeatures

class Keeps(PaperFeatures):
    kept = None

    def graphs(self, views):
        seen = super().graphs(views)
        if self.kept is None:
            self.kept = seen.node.copy()
        self.kept[...] = seen.node
        return replace(seen, node=self.kept)
"""


def test_own_features_may_write_into_the_same_array_again(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "kept_array.py").write_text(OWN)
    env = SwarmVectorEnv(NUM_ENVS, "random-walk", features="kept_array:Keeps", **SMALL)
    held, _ = env.reset(seed=1)
    before = copy.deepcopy(held)
    env.step(actions(1)[0])
    same(held, before)


def test_robots_sense_alike_beside_other_missions():
    ours, theirs = both(AutoresetMode.NEXT_STEP, with_sensors=True, **SCANNERS)
    seen = ours.reset(seed=1)[0]
    same(seen, theirs.reset(seed=1)[0])
    assert seen["sensors"].shape == (NUM_ENVS, 5, 14)
    for action in actions(3):
        same(ours.step(action)[0], theirs.step(action)[0])
