"""Runs as a whole: the optimiser's schedule, beginnings, budgets, refusals."""

from dataclasses import replace

import pytest
import torch
from safetensors.torch import load_file
from small_runs import difference, run, small_training
from tiny_policies import save_tiny

from swarm_mj.learning import train
from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.run_folder import CHECKPOINT, INIT, SETTINGS
from swarm_mj.policies.stored import read_policy
from swarm_mj.system.outputs import owned


def with_ppo(training, **changes):
    return replace(training, ppo=replace(training.ppo, **changes))


def test_the_optimiser_steps_at_that_rate():
    """Two passes a rollout and three minibatches a pass: the third rollout begins at step 12."""
    training = with_ppo(small_training(), learning_rate=1e-3, decay=0.5, decay_steps=12)
    model, _ = make_model(training)
    for rollouts, rate in ((2, 1e-3), (4, 0.5e-3)):
        num_steps = rollouts * training.ppo.num_steps * model.n_envs - model.num_timesteps
        model.learn(num_steps, reset_num_timesteps=False)
        (group,) = model.policy.optimizer.param_groups
        assert group["lr"] == pytest.approx(rate)
        made = next(iter(model.policy.optimizer.state.values()))["step"]
        assert made == rollouts * 2 * 3


def test_the_same_settings_are_the_same_policy_and_other_seeds_others(tmp_path):
    weights = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        run(small_training(seed=seed), tmp_path / name, 64)
        weights.append(load_file(tmp_path / name / "policy.safetensors"))
    assert not difference(weights[0], weights[1])
    assert difference(weights[0], weights[2])


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_a_run_begins_with_the_policy_it_is_given(tmp_path, credit):
    """The best policy before the first rollout is that policy itself."""
    given = save_tiny(tmp_path / "given", "extended")
    training = small_training(credit, network=given.shape, features="extended", held_out=1)

    def enough(status):
        return status.evaluated is not None or not status.progress.curve

    run(training, tmp_path / "run", listener=enough, init=tmp_path / "given")
    for folder in ("policy", INIT):
        kept, _ = read_policy(tmp_path / "run" / folder)
        for name, tensor in kept.state_dict().items():
            assert torch.equal(tensor, given.state_dict()[name])


def test_mixed_sizes_are_trained_on_and_evaluated_together(tmp_path):
    training = small_training(sizes=(3, 6))
    model, _ = make_model(training)
    sizes = [batch.mission.num_robots for batch in env_of(model).batches]
    assert sizes == [3, 6, 3, 6]
    progress = run(training, tmp_path / "run", 64)
    _, config = read_policy(tmp_path / "run")
    assert config.evaluation["missions"] == 4
    assert config.training["robots"] == [3, 6]
    assert progress.decisions == 64


def test_missions_that_cannot_be_made_leave_nothing(tmp_path):
    training = small_training()
    sparse = replace(training, mission=replace(training.mission, range_ratio=0.01))
    with pytest.raises(ValueError, match="too sparse"):
        run(sparse, tmp_path / "run", 1)
    assert not (tmp_path / "run").exists()


def test_training_that_diverges_says_so_and_keeps_what_was_before(tmp_path, monkeypatch):
    monkeypatch.setattr("swarm_mj.learning.ppo.decayed_rate", lambda *_: 1e33)
    with pytest.raises(ValueError, match=r"no longer finite after \d+ decisions; begin a new run"):
        run(small_training(), tmp_path / "run", 320)
    read_policy(tmp_path / "run")


def test_a_budget_is_met_by_whole_rollouts_and_no_more(tmp_path):
    for budget, made in ((32, 32), (33, 64)):
        progress = run(small_training(held_out=1), tmp_path / f"{budget}", budget)
        assert progress.decisions == made
        assert progress.curve[-1]["decisions"] == made


def test_a_run_that_is_done_does_nothing_more_when_resumed(tmp_path):
    training = small_training(held_out=1)
    first = run(training, tmp_path / "run", 64)
    heard = []
    again = run(training, tmp_path / "run", 64, heard.append, is_resumed=True)
    assert again.curve == first.curve
    assert heard == []
    assert (tmp_path / "run" / SETTINGS).exists()


def test_a_run_that_is_owned_is_refused_before_its_missions_are_made(tmp_path, monkeypatch):
    monkeypatch.setattr(train, "make_model", lambda _: pytest.fail("made"))
    with owned(tmp_path / SETTINGS), pytest.raises(ValueError, match="being written by process"):
        run(small_training(), tmp_path)


def test_a_run_that_appears_meanwhile_is_not_continued(tmp_path, monkeypatch):
    """Another process begins and ends one between the look into the folder and owning it."""

    def owned_late(path):
        for name in (SETTINGS, CHECKPOINT):
            path.with_name(name).touch()
        return owned(path)

    monkeypatch.setattr(train, "owned", owned_late)
    with pytest.raises(ValueError, match="holds a run; go on with it by --resume"):
        run(small_training(), tmp_path)
