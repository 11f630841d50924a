"""The two VecEnvs: stable-baselines3's own checks, spaces, rewards, ends."""

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecCheckNan, VecMonitor

from swarm_mj.envs.mission_batch import make_batches
from swarm_mj.envs.vec_env import RobotEnv, TeamEnv, padded
from swarm_mj.mission import paper
from swarm_mj.protocol.buffers import NO_PARENT

ENVS = {"robot": RobotEnv, "team": TeamEnv}
WINDOWS, MISSIONS = 12, 8


def env_of(credit, sizes=(4,), task="random-walk", features="extended", **options):
    mission = paper(task, num_robots=sizes[0], num_windows=WINDOWS, range_ratio=0.7)
    rng = np.random.default_rng(1)
    return ENVS[credit](make_batches(mission, sizes, features, MISSIONS, 4, rng), **options)


def rows_of(observation):
    """The observation of each environment on its own."""
    count = len(observation["node"])
    return [{name: rows[e] for name, rows in observation.items()} for e in range(count)]


def drawn(env, rng):
    """Actions that speak now and then, to robots that exist."""
    teams = []
    for batch in env.batches:
        shape = (batch.num_missions, batch.mission.num_robots)
        silence = np.broadcast_to(np.arange(shape[1]), shape)
        team = np.where(rng.random(shape) < 0.3, rng.integers(0, shape[1], shape), silence)
        if isinstance(env, TeamEnv):
            unused = np.arange(shape[1], env.num_nodes)
            team = np.hstack([team, np.tile(unused, (len(team), 1))])
        teams.append(team)
    return np.concatenate([t if isinstance(env, TeamEnv) else t.ravel() for t in teams])


@pytest.mark.parametrize("features", ["paper", "reference", "extended"])
@pytest.mark.parametrize("credit", ENVS)
def test_random_actions_pass_stable_baselines_checks(credit, features):
    env = VecCheckNan(env_of(credit, features=features), raise_exception=True)
    monitored = VecMonitor(env)
    env.action_space.seed(1)
    observation = monitored.reset()
    num_episodes = 0
    for _ in range(2 * WINDOWS):
        assert all(map(env.observation_space.contains, rows_of(observation)))
        actions = np.array([env.action_space.sample() for _ in range(env.num_envs)])
        observation, reward, done, infos = monitored.step(actions)
        assert reward.shape == done.shape == (env.num_envs,)
        assert reward.dtype == np.float32
        assert done.dtype == np.bool_
        assert len(infos) == env.num_envs
        num_episodes += sum("episode" in info for info in infos)
    assert num_episodes == env.num_envs * (2 + 2 + 2 + 2) / 4


@pytest.mark.parametrize("sizes", [(4,), (3, 5)])
@pytest.mark.parametrize("credit", ENVS)
def test_observations_have_the_shapes_and_types_of_their_space(credit, sizes):
    env, rng = env_of(credit, sizes), np.random.default_rng(2)
    space = env.observation_space
    observation = env.reset()
    for _ in range(WINDOWS + 2):
        assert observation.keys() == space.spaces.keys()
        for name, rows in observation.items():
            assert rows.shape == (env.num_envs, *space[name].shape)
            assert np.can_cast(rows.dtype, space[name].dtype) or rows.dtype == np.bool_
        assert all(map(space.contains, rows_of(observation)))
        observation, _, _, infos = env.step(drawn(env, rng))
        for info in infos:
            if info:
                assert space.contains(info["terminal_observation"])


@pytest.mark.parametrize("credit", ENVS)
def test_missions_that_are_cut_are_truncated_and_others_end(credit):
    """Four batches of two missions of 12 windows; the first three are cut at 3, 6 and 9."""
    env, rng = env_of(credit), np.random.default_rng(2)
    env.reset()
    rows = env.num_envs // 4
    for window in range(1, 2 * WINDOWS + 1):
        _, _, done, infos = env.step(drawn(env, rng))
        for n in range(4):
            batch = slice(n * rows, (n + 1) * rows)
            first = 3 * (n + 1)
            ends = window in (first, first + WINDOWS)
            assert np.all(done[batch] == ends)
            for info in infos[batch]:
                assert bool(info) == (ends and window == first < WINDOWS)
                assert not info or info["TimeLimit.truncated"]


@pytest.mark.parametrize("credit", ENVS)
def test_a_terminal_observation_is_what_was_seen_at_the_end(credit):
    env, rng = env_of(credit, (3, 5)), np.random.default_rng(2)
    env.reset()
    for _ in range(3):
        observation, _, done, infos = env.step(drawn(env, rng))
    assert 0 < done.sum() < env.num_envs
    for row in np.flatnonzero(done):
        last = infos[row]["terminal_observation"]
        first = {name: rows[row] for name, rows in observation.items()}
        assert last.keys() == first.keys()
        assert np.any(last["node"] != first["node"])
        np.testing.assert_array_equal(last["node"].shape, first["node"].shape)
    if credit == "robot":
        np.testing.assert_array_equal(
            [infos[row]["terminal_observation"]["owner"] for row in np.flatnonzero(done)],
            observation["owner"][done],
        )


def test_a_robots_reward_is_its_credit_per_pair():
    env, rng = env_of("robot", (3, 5)), np.random.default_rng(2)
    env.reset()
    for _ in range(6):
        _, reward, _, _ = env.step(drawn(env, rng))
        by_hand = []
        for batch, transition in zip(env.batches, env.transitions, strict=True):
            pairs = batch.mission.num_robots**2
            by_hand += [credit / pairs for mission in transition.credit for credit in mission]
        np.testing.assert_allclose(reward, by_hand, rtol=1e-6)
        assert np.any(reward != 0.0)


def test_eq10_a_teams_reward_is_the_age_over_the_missions_duration():
    env, rng = env_of("team", (3, 5)), np.random.default_rng(2)
    env.reset()
    for window in (1, 2):
        _, reward, _, _ = env.step(drawn(env, rng))
        ages = []
        for batch in env.batches:
            for timestamp in batch._swarm.buffers.timestamp:
                each = [window - t for row in timestamp for t in row]
                ages.append(sum(each) / len(each))
        np.testing.assert_allclose(reward, [-age / WINDOWS for age in ages], rtol=1e-6)


def test_eq17_the_other_reward_is_the_velocity_variance():
    env = env_of("team", task="flocking", reward="velocity-variance")
    rng = np.random.default_rng(2)
    env.reset()
    for _ in range(2):
        _, reward, _, _ = env.step(drawn(env, rng))
        by_hand = []
        for batch in env.batches:
            for velocity in batch._swarm.states.velocity_mps:
                mean = [sum(v[axis] for v in velocity) / len(velocity) for axis in range(2)]
                squares = [(v[0] - mean[0]) ** 2 + (v[1] - mean[1]) ** 2 for v in velocity]
                by_hand.append(-sum(squares) / len(velocity))
        np.testing.assert_allclose(reward, by_hand, rtol=1e-5)
        assert np.all(reward < 0.0)


def test_robots_that_do_not_exist_see_nothing_and_may_only_be_silent():
    env = env_of("team", (3, 5))
    observation = env.reset()
    is_robot = observation["is_robot"].astype(bool)
    np.testing.assert_array_equal(is_robot.sum(axis=1), [3, 3, 5, 5, 3, 3, 5, 5])
    for e, i in zip(*np.nonzero(~is_robot), strict=True):
        np.testing.assert_array_equal(observation["may_address"][e, i], np.arange(5) == i)
        assert np.all(observation["node"][e, i] == 0.0)
        assert np.all(observation["parent"][e, i] == -1)
    for e, i in zip(*np.nonzero(is_robot), strict=True):
        assert not np.any(observation["may_address"][e, i][~is_robot[e]])


def test_rows_of_credit_per_robot_are_teams_robot_by_robot():
    env = env_of("robot", (3, 5))
    expected = [*range(3), *range(3), *range(5), *range(5)] * 2
    np.testing.assert_array_equal(env.reset()["owner"][:, 0], expected)


def test_padding_adds_nodes_that_nobody_hears_or_addresses():
    mission = paper("random-walk", num_robots=5, num_windows=20, range_ratio=0.6)
    batches = make_batches(mission, (3, 5), "extended", 4, 2, np.random.default_rng(1))
    small, large = (batch.restart() for batch in batches)
    rows = padded([small, large], 5)
    assert rows["node"].shape[:2] == (2 * 3 + 2 * 5, 5)
    for name in ("node", "parent", "may_address"):
        np.testing.assert_array_equal(rows[name][:6, :3], getattr(small, name))
        np.testing.assert_array_equal(rows[name][6:], getattr(large, name))
    assert np.all(rows["node"][:6, 3:] == 0.0)
    assert np.all(rows["parent"][:6, 3:] == NO_PARENT)
    assert not np.any(rows["may_address"][:6, 3:])
    turns = np.concatenate([small.has_turn, large.has_turn])
    np.testing.assert_array_equal(rows["has_turn"][:, 0], turns)


@pytest.mark.parametrize("credit", ENVS)
def test_reset_starts_missions_over(credit):
    env, rng = env_of(credit), np.random.default_rng(2)
    first = env.reset()
    actions = [drawn(env, rng) for _ in range(2)]
    rewards = [env.step(action)[1] for action in actions]
    again = env.reset()
    for name, rows in first.items():
        np.testing.assert_array_equal(again[name], rows)
    for action, reward in zip(actions, rewards, strict=True):
        np.testing.assert_array_equal(env.step(action)[1], reward)


@pytest.mark.parametrize("credit", ENVS)
def test_what_environments_of_their_own_would_have_is_refused(credit):
    env = env_of(credit)
    assert env.get_attr("num_teams") == [MISSIONS] * env.num_envs
    assert env.env_is_wrapped(VecMonitor) == [False] * env.num_envs
    with pytest.raises(AttributeError, match="no environment has its own wind"):
        env.set_attr("wind", 1.0)
    with pytest.raises(AttributeError, match="no environment has its own fly"):
        env.env_method("fly")
    env.close()
