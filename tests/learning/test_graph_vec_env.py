"""Training's VecEnv: staggered ends, fresh seeds, histories, rewards, padding."""

from dataclasses import replace

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecCheckNan, VecMonitor

from swarm_mj.envs.credit import credits_over
from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED, LAST_TRAINING_SEED
from swarm_mj.learning.graph_vec_env import GraphVecEnv
from swarm_mj.learning.settings import HELD_OUT_SEED, usual_settings
from swarm_mj.mission import paper
from swarm_mj.policies.gnn.feature_sets import num_features
from swarm_mj.simulation.swarm import Swarm

CREDITS = ("robot", "team")
WINDOWS, MISSIONS = 12, 8


def env_of(credit, sizes=(4,), task="random-walk", features="extended", seed=1, **changes):
    mission = paper(task, num_robots=sizes[0], num_windows=WINDOWS, range_ratio=0.7)
    usual = usual_settings(credit, mission, sizes)
    network = replace(usual.network, num_features=num_features(features))
    its = {"network": network, "features": features, "missions": MISSIONS, "groups": 4}
    its["unknown_age"] = 0.0
    return GraphVecEnv(replace(usual, **(its | changes)), np.random.default_rng(seed))


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
        if env.agent == "team":
            unused = np.arange(shape[1], env.num_nodes)
            team = np.hstack([team, np.tile(unused, (len(team), 1))])
        teams.append(team)
    return np.concatenate([t if env.agent == "team" else t.ravel() for t in teams])


@pytest.mark.parametrize(("features", "sizes"), [("extended", (4,)), ("paper", (3, 5))])
@pytest.mark.parametrize("credit", CREDITS)
def test_random_actions_pass_stable_baselines_checks(credit, features, sizes):
    inner, rng = env_of(credit, sizes, features=features), np.random.default_rng(2)
    monitored = VecMonitor(VecCheckNan(inner, raise_exception=True))
    observation, num_episodes = monitored.reset(), 0
    for _ in range(2 * WINDOWS):
        assert all(map(inner.observation_space.contains, rows_of(observation)))
        observation, reward, done, infos = monitored.step(drawn(inner, rng))
        assert reward.shape == done.shape == (inner.num_envs,)
        assert (reward.dtype, done.dtype) == (np.float32, np.bool_)
        num_episodes += sum("episode" in info for info in infos)
        for row, info in zip(rows_of(observation), infos, strict=True):
            if "TimeLimit.truncated" in info:  # with the last view, not the next mission's first
                last = info["terminal_observation"]
                assert inner.observation_space.contains(last)
                assert np.any(last["node"] != row["node"])
    assert num_episodes == inner.num_envs * 2


@pytest.mark.parametrize("credit", CREDITS)
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


def test_missions_of_training_may_end_before_those_that_are_asked_for():
    """Four batches that first end after 2, 4, 6 and 8 windows; from then on after 8 of 12."""
    env, rng = env_of("robot", train_windows=(8,)), np.random.default_rng(2)
    env.reset()
    rows = env.num_envs // 4
    for window in range(1, 2 * 8 + 1):
        _, _, done, infos = env.step(drawn(env, rng))
        for n in range(4):
            batch = slice(n * rows, (n + 1) * rows)
            assert np.all(done[batch] == (window in (2 * (n + 1), 2 * (n + 1) + 8)))
            # They were cut off, so what would have come next has a value.
            assert all(bool(info) == bool(done[batch][0]) for info in infos[batch])
    assert env.batches[0].mission.num_windows == WINDOWS


def test_missions_of_training_may_have_lengths_that_are_drawn_anew():
    """From 3 to 7 of 12 windows, the first ones cut at their shares; as the generator draws."""
    env, rng = env_of("robot", train_windows=(3, 7)), np.random.default_rng(2)
    dice = np.random.default_rng(1)

    def draw():
        length = dice.integers(3, 8)
        dice.integers(FIRST_TRAINING_SEED, LAST_TRAINING_SEED, MISSIONS // 4)
        return int(length)

    left = [max(1, draw() * (n + 1) // 4) for n in range(4)]
    assert [batch.last_window for batch in env.batches] == left
    env.reset()
    rows = env.num_envs // 4
    lengths = set()
    for _ in range(60):
        _, _, done, infos = env.step(drawn(env, rng))
        for n in range(4):
            left[n] -= 1
            assert done[n * rows] == (left[n] == 0)
            assert bool(infos[n * rows]) == (left[n] == 0)  # it was cut off
            if left[n] == 0:
                left[n] = draw()
                lengths.add(left[n])
                assert env.batches[n].last_window == left[n]
    assert lengths == {3, 4, 5, 6, 7}


def test_a_robots_reward_is_its_credit_per_pair():
    """Next to teams that fly alike until the last window, in which one robot each is silent.

    How much T falls short there, a mean over pairs; T of robots themselves is always now.
    """
    env, rng = env_of("robot", (3, 5)), np.random.default_rng(2)
    env.reset()
    for _ in range(3):
        before = [(batch.seeds, [*batch.recipients]) for batch in env.batches]
        actions = drawn(env, rng)
        _, reward, _, _ = env.step(actions)
    by_hand, last = [], np.split(actions, [6, 16, 22])
    for batch, (seeds, flown), recipient in zip(env.batches, before, last, strict=True):
        size = batch.mission.num_robots
        recipient = recipient.reshape(2, size)

        def known(last_recipient, batch=batch, seeds=seeds, flown=flown):
            swarm = Swarm(batch.mission, seeds)
            for each in [*flown, last_recipient]:
                swarm.step_with_recipients(each.astype(int))
            return swarm.buffers.timestamp.sum(axis=(1, 2))

        without = [np.where(np.arange(size) == i, i, recipient) for i in range(size)]
        credit = [known(recipient) - known(each) for each in without]
        by_hand += (np.stack(credit, axis=1) / size**2).ravel().tolist()
    np.testing.assert_allclose(reward, by_hand, rtol=1e-5, atol=1e-7)
    assert np.any(reward != 0.0)


def several_kinds(credit="robot", **changes):
    """Two sizes by two missions that differ in task, range and channel: four batches."""
    mission = paper("random-walk", num_robots=3, num_windows=WINDOWS, range_ratio=0.7)
    other = paper("flocking", num_robots=3, num_windows=WINDOWS, range_ratio=1.0, erasure=0.2)
    training = replace(usual_settings(credit, mission, (3, 5)), other_missions=(other,))
    training = replace(training, missions=MISSIONS, groups=4, **changes)
    return training, GraphVecEnv(training, np.random.default_rng(1))


@pytest.mark.parametrize("credit", CREDITS)
def test_every_kind_of_mission_has_its_batches(credit):
    training, env = several_kinds(credit)
    flown = [batch.mission for batch in env.batches]
    assert flown == list(training.kinds)
    assert [(each.task, each.range_ratio, each.erasure, each.num_robots) for each in flown] == [
        ("random-walk", 0.7, 0.0, 3),
        ("random-walk", 0.7, 0.0, 5),
        ("flocking", 1.0, 0.2, 3),
        ("flocking", 1.0, 0.2, 5),
    ]
    assert env.num_nodes == 5


def test_credits_of_each_kind_are_divided_by_their_own_scale():
    """Next to the same missions without scales: a factor each, by all of its credits so far."""
    (_, plain), (_, scaled) = several_kinds(), several_kinds(credit_scaling="kind")
    rng = np.random.default_rng(2)
    total, count = np.zeros(4), np.zeros(4)
    plain.reset()
    scaled.reset()
    for _ in range(2 * WINDOWS):
        actions = drawn(plain, rng)
        _, credit, _, _ = plain.step(actions)
        _, reward, _, _ = scaled.step(actions)
        for n, envs in enumerate(plain._envs):
            its = credit[envs].astype(float)
            total[n] = 0.999 * total[n] + np.sum(its**2)
            count[n] = 0.999 * count[n] + np.count_nonzero(its)
            if count[n]:
                expected = its / np.sqrt(total[n] / count[n])
                np.testing.assert_allclose(reward[envs], expected, rtol=1e-5, atol=1e-7)
    assert len(set(np.round(total / count, 6))) == 4  # each has a scale of its own


def test_batches_of_one_kind_share_its_scale():
    _, env = several_kinds(credit_scaling="kind")
    training, twice = several_kinds()
    twice = GraphVecEnv(
        replace(training, groups=8, credit_scaling="kind"), np.random.default_rng(1)
    )
    assert len(env.credit_scales) == len(twice.credit_scales) == 4
    twice.reset()
    rng = np.random.default_rng(2)
    counts = np.zeros(4)
    for _ in range(3):
        _, reward, _, _ = twice.step(drawn(twice, rng))
        counts *= 0.999**2
        for n, envs in enumerate(twice._envs):
            factor = 0.999 if n < 4 else 1.0  # the first batch counts as a window before
            counts[n % 4] += factor * np.count_nonzero(reward[envs])
    np.testing.assert_allclose([scale.count for scale in twice.credit_scales], counts)


def kept_windows(batch):
    """A list that is filled with the windows that a batch flies for their credits."""
    flown = []
    fly = batch.fly_for_credit
    batch.fly_for_credit = lambda *given: flown.append(fly(*given)) or flown[-1]
    return flown


def scaled_by_hand(credit, total, count):
    """A window's credits by the root mean square of those of their kind, which they change."""
    total[...] = 0.999 * total + np.sum(credit**2)
    count[...] = 0.999 * count + np.count_nonzero(credit)
    return credit / np.sqrt(total / count) if count else credit


@pytest.mark.parametrize("scaling", ["none", "kind"])
def test_credits_taken_are_those_of_the_windows_flown_since(scaling):
    """Of packets sent or only considered; two batches of each kind share its scale, by hand."""
    training, _ = several_kinds(credit_scaling=scaling)
    env = GraphVecEnv(replace(training, groups=8), np.random.default_rng(1))
    horizon, length = 3, WINDOWS + 2
    rng = np.random.default_rng(2)
    asked = []
    env.considered_recipient = lambda: asked[-1]
    flown = [kept_windows(batch) for batch in env.batches]
    total, count = np.zeros(4), np.zeros(4)
    env.reset()
    for _ in range(2):  # the second time, of what was flown after the first
        for its in flown:
            its.clear()
        for _ in range(length):
            actions = drawn(env, rng)
            own = env._owner[:, 0]
            asked.append(np.where(actions == own, drawn(env, rng), actions))
            _, reward, _, _ = env.step(actions)
            assert np.all(reward == 0.0)
        credit, is_whole = env.take_credits(horizon)
        assert credit.shape == is_whole.shape == (length, env.num_envs)
        considers = np.array(asked[-length:]) != own
        assert np.any(credit[considers] < 0.0)
        assert np.any(credit[considers] > 0.0)
        assert np.all(credit[~considers] == 0.0)
        found = [credits_over(its, horizon) for its in flown]
        for window in range(length):
            for n, (batch, envs) in enumerate(zip(env.batches, env._envs, strict=True)):
                its = found[n].credit[window].ravel() / batch.mission.num_robots**2
                assert np.all(is_whole[window, envs] == found[n].is_whole[window])
                if scaling == "kind" and found[n].is_whole[window]:
                    its = scaled_by_hand(its, total[n % 4 : n % 4 + 1], count[n % 4 : n % 4 + 1])
                np.testing.assert_allclose(credit[window, envs], its, rtol=1e-4, atol=1e-6)
        assert 0 < np.sum(is_whole) < is_whole.size


def test_windows_before_a_reset_have_no_credits():
    _, env = several_kinds()
    rng = np.random.default_rng(2)
    asked = []
    env.considered_recipient = lambda: asked[-1]

    def fly(num_windows):
        for _ in range(num_windows):
            asked.append(drawn(env, rng))
            env.step(asked[-1])

    env.reset()
    fly(3)
    env.reset()
    fly(5)
    assert env.take_credits(2).credit.shape == (5, env.num_envs)
    fly(3)
    begun = [(batch.seeds, batch.last_window) for batch in env.batches]
    seeds, last_windows = zip(*begun, strict=True)
    env.replay(seeds, last_windows, [np.zeros((0, *batch.shape)) for batch in env.batches])
    fly(4)
    assert env.take_credits(2).credit.shape == (4, env.num_envs)


def mean_age(swarm, b):
    """Of all pairs of a mission, now (Eq. 10)."""
    return np.mean(swarm.now[b] - swarm.buffers.timestamp[b])


def velocity_variance(swarm, b):
    """Of a mission's robots, now (Eq. 17)."""
    return np.var(swarm.states.velocity_mps[b], axis=0).sum()


@pytest.mark.parametrize(
    ("reward", "cost", "scale"),
    [("aoi", mean_age, WINDOWS), ("velocity-variance", velocity_variance, 1)],
)
def test_a_teams_reward_is_its_age_over_the_missions_duration_or_its_velocity_variance(
    reward, cost, scale
):
    env, rng = env_of("team", (3, 5), task="flocking", reward=reward), np.random.default_rng(2)
    env.reset()
    for _ in range(2):
        _, found, _, _ = env.step(drawn(env, rng))
        by_hand = [-cost(batch.swarm, b) / scale for batch in env.batches for b in range(2)]
        np.testing.assert_allclose(found, by_hand, rtol=1e-5)
        assert np.all(found < 0.0)


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


def test_reset_starts_missions_over():
    env, rng = env_of("robot"), np.random.default_rng(2)
    first = env.reset()
    actions = [drawn(env, rng) for _ in range(2)]
    rewards = [env.step(action)[1] for action in actions]
    again = env.reset()
    for name, rows in first.items():
        np.testing.assert_array_equal(again[name], rows)
    for action, reward in zip(actions, rewards, strict=True):
        np.testing.assert_array_equal(env.step(action)[1], reward)


@pytest.mark.parametrize("sizes", [(4,), (3, 5)])
def test_every_mission_has_its_own_seed_that_is_not_held_out(sizes):
    env, rng = env_of("team", sizes), np.random.default_rng(2)
    assert [batch.mission.num_robots for batch in env.batches] == [*sizes] * (4 // len(sizes))
    seen = []
    for _ in range(2 * WINDOWS + 3):
        seen += [batch.seeds for batch in env.batches if batch.seeds not in seen]
        env.step(drawn(env, rng))
    drawn_seeds = [seed for seeds in seen for seed in seeds]
    assert len(drawn_seeds) == len(set(drawn_seeds)) == 2 * (4 + 4 + 4)
    assert min(drawn_seeds) >= FIRST_TRAINING_SEED == 2**40 > HELD_OUT_SEED


def test_the_view_after_an_end_is_the_new_missions_start():
    env, rng = env_of("robot"), np.random.default_rng(2)
    for _ in range(3):
        observation, _, done, _ = env.step(drawn(env, rng))
    first = env.batches[0]
    first._extractor.start(2, 4)
    expected = first._extractor.graphs(Swarm(first.mission, first.seeds).views)
    np.testing.assert_array_equal(observation["node"][done], expected.node)
    np.testing.assert_array_equal(observation["parent"][done], expected.parent)


@pytest.mark.parametrize(("missions", "groups"), [(7, 4), (2, 4), (4, 1)])
def test_missions_that_cannot_be_shared_out_are_refused(missions, groups):
    with pytest.raises(ValueError, match=f"not {missions}"):
        env_of("robot", (3, 5), missions=missions, groups=groups)


def test_seeds_are_the_trainings_own_whatever_is_asked_for():
    """Two environments alike, of which one is asked for seeds, begin the same missions later."""
    asked, other = env_of("robot"), env_of("robot")
    assert set(asked.seed(7)) == {None}
    for n in range(len(asked.batches)):
        asked._begin(n)
        other._begin(n)
    assert [batch.seeds for batch in asked.batches] == [batch.seeds for batch in other.batches]
    with pytest.raises(AttributeError, match="no environment has its own action_masks"):
        asked.env_method("action_masks")
