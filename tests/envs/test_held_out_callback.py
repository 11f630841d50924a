"""Evaluations while a model learns: always the same missions, and the best model is kept."""

import signal

import numpy as np
import pytest
import torch
from channels import Lossy
from stable_baselines3 import PPO
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.vec_env import VecNormalize

import swarm_mj
from swarm_mj.envs import held_out_callback
from swarm_mj.envs.sb3 import Flown, HeldOutCallback, make_vec_env

torch.set_num_threads(1)
SMALL = {"num_robots": 4, "num_windows": 8, "range_ratio": 0.4}
ROLLOUT = 2 * 4 * 8  # timesteps of two missions


class Rows(KVWriter):
    """A log that keeps what was written, row by row."""

    def __init__(self):
        self.rows = []

    def write(self, key_values, key_excluded, step=0):  # noqa: ARG002 - as the base class has it
        if "eval/aoi_mean" in key_values:
            self.rows.append((step, key_values["eval/aoi_mean"]))

    def close(self):
        pass


def new_model(normalises=False, **options):
    env = make_vec_env("stationary", 2, reward="credit", **{**SMALL, **options})
    env = VecNormalize(env, norm_obs_keys=["observation"]) if normalises else env
    # A high rate: the age should move from one evaluation to the next.
    return PPO("MultiInputPolicy", env, n_steps=8, batch_size=64, learning_rate=0.03, seed=7)


def learned(model, callback, timesteps=5 * ROLLOUT, **options):
    log = Rows()
    model.set_logger(Logger(None, [log]))
    model.learn(timesteps, callback=callback, **options)
    return log.rows


def test_ages_are_those_of_flights_on_the_same_missions():
    model = new_model()
    callback = HeldOutCallback(num_missions=3, seed=3000, every=2 * ROLLOUT)
    rows = learned(model, callback)
    assert [step for step, _ in rows] == [0, 2 * ROLLOUT, 4 * ROLLOUT, 5 * ROLLOUT]
    policy = Flown(model)
    ages = [
        swarm_mj.fly(policy.mission, policy=policy, seed=seed, record=False).summary.aoi_mean
        for seed in (3000, 3001, 3002)
    ]
    assert callback.aoi_mean == rows[-1][1] == pytest.approx(np.mean(ages), rel=1e-12)
    assert callback.best_aoi_mean == min(age for _, age in rows)
    assert len({age for _, age in rows}) > 1


def test_unless_the_policy_changes_an_evaluation_repeats_itself():
    model = new_model()
    model.policy.optimizer.param_groups[0]["lr"] = 0.0
    model.lr_schedule = lambda _: 0.0
    ages = [age for _, age in learned(model, HeldOutCallback(num_missions=2, every=ROLLOUT))]
    assert len(ages) == 6
    assert len(set(ages)) == 1


@pytest.mark.parametrize("channel", [None, Lossy()])
def test_training_is_the_same_without_it(channel):
    """Also where the channel draws: evaluations have another one of the kind."""

    def weights(callback):
        model = new_model(channel=channel)
        model.learn(3 * ROLLOUT, callback=callback)
        return model.policy.state_dict()

    with_it = weights(HeldOutCallback(num_missions=2, every=ROLLOUT))
    for name, tensor in weights(None).items():
        assert torch.equal(with_it[name], tensor), name


@pytest.mark.parametrize("normalises", [False, True])
def test_the_best_model_is_kept_with_its_averages(tmp_path, normalises):
    model = new_model(normalises)
    best = tmp_path / "runs" / "best.zip"
    callback = HeldOutCallback(num_missions=3, every=ROLLOUT, best_path=best.with_suffix(""))
    learned(model, callback)
    names = ["best.pkl", "best.zip"] if normalises else ["best.zip"]
    assert sorted(path.name for path in best.parent.iterdir()) == names
    averages = None
    if normalises:
        env = make_vec_env("stationary", 2, **SMALL)
        averages = VecNormalize.load(str(best.with_suffix(".pkl")), env)
    policy = Flown(PPO.load(best), Flown(model).mission, normalize=averages)
    ages = [
        swarm_mj.fly(policy.mission, policy=policy, seed=seed, record=False).summary.aoi_mean
        for seed in (3000, 3001, 3002)
    ]
    assert np.mean(ages) == pytest.approx(callback.best_aoi_mean, rel=1e-12)


def test_training_that_goes_on_keeps_the_best(tmp_path):
    model = new_model()
    callback = HeldOutCallback(num_missions=2, every=ROLLOUT, best_path=tmp_path / "best.zip")
    rows = learned(model, callback, ROLLOUT)
    rows += learned(model, callback, ROLLOUT, reset_num_timesteps=False)
    assert [step for step, _ in rows] == [0, ROLLOUT, 2 * ROLLOUT]
    assert callback.best_aoi_mean == min(age for _, age in rows)


def test_other_missions_than_the_trainings_may_be_held_out():
    mission = swarm_mj.paper("stationary", **{**SMALL, "num_windows": 30})
    callback = HeldOutCallback(mission, num_missions=2)
    learned(new_model(), callback, ROLLOUT)
    policy = Flown(new_model(), mission)
    assert policy.mission.num_windows == 30
    assert callback.aoi_mean > 4.0  # older than any mission of 8 windows, (1 - 1/4) 9/2 windows


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"every": 0}, "every must be 1 or more, not 0"),
        ({"num_missions": 0}, "num_missions must be 1 or more, not 0"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(ValueError, match=message):
        HeldOutCallback(**options)


def test_another_environments_model_is_refused_before_it_learns():
    model = PPO("MlpPolicy", "CartPole-v1", n_steps=8, batch_size=8)
    with pytest.raises(ValueError, match="trained on another environment"):
        model.learn(8, callback=HeldOutCallback())
    assert model.num_timesteps == 0


def test_ctrl_c_parts_no_model_from_its_averages(tmp_path, monkeypatch):
    write = held_out_callback.write_bytes

    def interrupted(path, content):
        if path.suffix == ".zip":
            signal.raise_signal(signal.SIGINT)
        write(path, content)

    monkeypatch.setattr(held_out_callback, "write_bytes", interrupted)
    model = new_model(normalises=True)
    with pytest.raises(KeyboardInterrupt):
        model.learn(ROLLOUT, callback=HeldOutCallback(num_missions=2, best_path=tmp_path / "best"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["best.pkl", "best.zip"]
