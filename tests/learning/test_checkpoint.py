"""Checkpoints: sound ones come back to the last bit; all others are refused and run nothing."""

import copy
import math
import pickle
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import difference, run, small_training

from swarm_mj.learning.checkpoint import IN_A_ROW, acting_network, load, restore, save
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.run_folder import CHECKPOINT
from swarm_mj.learning.selection import Accumulator, Progress

TRAINING = small_training()


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """The bytes of a sound checkpoint."""
    folder = tmp_path_factory.mktemp("run")
    run(TRAINING, folder, 32)
    return (folder / CHECKPOINT).read_bytes()


def load_bytes(folder, content, training=TRAINING):
    (folder / "c.pt").write_bytes(content)
    model = make_model(training)
    return load(folder / "c.pt", training, model)[0]


def changed(kept, folder, change):
    """The bytes of a checkpoint after a change of what is in it."""
    (folder / "before.pt").write_bytes(kept)
    state = torch.load(folder / "before.pt", weights_only=True)
    change(state)
    torch.save(state, folder / "after.pt")
    return (folder / "after.pt").read_bytes()


def without(name):
    return lambda state: state.pop(name)


@pytest.mark.parametrize(
    ("share", "change", "complaint"),
    [
        *((share, None, "c.pt is damaged, or none; begin a new") for share in (0.0, 0.3, 0.999)),
        (1.0, lambda state: state.clear(), "c.pt is no checkpoint"),
        (1.0, lambda s: s.update(version=99), "version 99, and this swarm_mj reads 4; resume with"),
        (1.0, without("weights"), r"c.pt is damaged, or another run's \("),
    ],
)
def test_what_is_no_checkpoint_is_refused_in_one_line(kept, tmp_path, share, change, complaint):
    content = changed(kept, tmp_path, change) if change else kept[: int(share * len(kept))]
    with pytest.raises(ValueError, match=complaint) as caught:
        load_bytes(tmp_path, content)
    assert "\n" not in str(caught.value)


def test_a_sound_one_is_taken_by_its_own_run_alone(kept, tmp_path):
    assert load_bytes(tmp_path, kept).decisions == 32
    other = replace(TRAINING, ppo=replace(TRAINING.ppo, entropy=0.5))
    with pytest.raises(ValueError, match="made with other settings than the run's"):
        load_bytes(tmp_path, kept, other)


def test_progress_comes_back_to_the_last_bit(tmp_path):
    row = dict.fromkeys(sorted(IN_A_ROW), 1 / 3)
    progress = Progress(
        decisions=8,  # of 4 teams, each of 5 robots
        minutes=0.1 + 0.2,
        next_evaluation=12,
        curve=[row, row | {"train/explained_variance": math.nan}],
        since_evaluation=Accumulator(seconds=1e-9 / 3, decisions=5, age_windows=0.1),
        optimiser={"train/entropy": 2 / 3},
    )
    model = make_model(TRAINING)
    model.num_timesteps = 2 * 4 * 5
    model._last_episode_starts = np.ones(model.n_envs, dtype=bool)
    save(tmp_path / "c.pt", TRAINING, model, progress, {0: acting_network(model)})
    again, networks = load(tmp_path / "c.pt", TRAINING, make_model(TRAINING))
    assert math.isnan(again.curve[1].pop("train/explained_variance"))
    progress.curve[1].pop("train/explained_variance")
    assert again == progress
    assert not difference(networks[0].state_dict(), acting_network(model).state_dict())
    assert again.best_objective == math.inf


def test_one_that_would_grow_when_it_is_read_is_refused(kept, tmp_path):
    (tmp_path / "c.pt").write_bytes(kept)
    with zipfile.ZipFile(tmp_path / "c.pt") as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "c.pt", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    with pytest.raises(ValueError, match="is damaged, or none"):
        load(tmp_path / "c.pt", TRAINING, make_model(TRAINING))


def test_one_that_would_run_code_does_not(tmp_path):
    class Trap:
        def __reduce__(self):
            return (open, (str(tmp_path / "sprung"), "w"))

    torch.save({"policy": Trap()}, tmp_path / "zipped")
    for content in ((tmp_path / "zipped").read_bytes(), pickle.dumps(Trap())):
        with pytest.raises(ValueError, match="is damaged, or none; begin a new run with another"):
            load_bytes(tmp_path, content)
    assert not (tmp_path / "sprung").exists()


def test_one_that_is_too_large_missing_or_elsewhere_is_refused(kept, tmp_path):
    run_of = make_model(TRAINING)
    with pytest.raises(ValueError, match="there is no checkpoint"):
        load(tmp_path / "none.pt", TRAINING, run_of)
    (tmp_path / "run").mkdir()
    (tmp_path / "kept.pt").write_bytes(kept)
    (tmp_path / "run" / "c.pt").symlink_to(tmp_path / "kept.pt")
    with pytest.raises(ValueError, match="is a link that leads out of"):
        load(tmp_path / "run" / "c.pt", TRAINING, run_of)
    with (tmp_path / "large.pt").open("wb") as file:
        file.truncate(10**9)
    with pytest.raises(ValueError, match=r"large.pt may have up to \d+ bytes, not 1000000000"):
        load(tmp_path / "large.pt", TRAINING, run_of)


# Shapes, kinds and ranges. The fault tests craft others, of every part of a state.


@pytest.fixture(scope="module")
def states(tmp_path_factory):
    """The states of two runs' checkpoints, and models like theirs."""
    flock = {"credit": "team", "task": "flocking", "reward": "velocity-variance"}
    trainings, found = {"robots": TRAINING, "flock": small_training(**flock)}, {}
    for name, training in trainings.items():
        folder = tmp_path_factory.mktemp(name)
        run(training, folder, 64)
        state = torch.load(folder / CHECKPOINT, weights_only=True)
        found[name] = state, make_model(training)
    return found


@pytest.mark.parametrize(
    ("whose", "change", "complaint"),
    [
        ("robots", lambda s: s["numpy_rng"][1].pop(), "length >= 624"),
        ("robots", lambda s: s["progress"].update(wings=2), "unknown field `wings`"),
        ("robots", lambda s: s["progress"].update(decisions=60), "its steps are not those of"),
        ("robots", lambda s: s["progress"]["curve"][0].update(aoi=math.inf), "not finite"),
        ("robots", lambda s: s["progress"]["curve"][0].update(aoi="1"), "Expected `float`, got"),
        ("robots", lambda s: s["progress"]["choice"].update(num_missions=-1), "`int` >= 0"),
        ("robots", lambda s: s["adam"].pop(3), "adam must have 0, 1, 2"),
        ("robots", lambda s: s["adam"][0].update(exp_avg=torch.zeros(6, 18).to_sparse()), "6, 18"),
        ("robots", lambda s: s["candidates"].popitem(), "candidates must have"),
        ("robots", lambda s: s["candidates"][64]["output.bias"].fill_(math.inf), "not finite"),
        ("robots", lambda s: s["last_windows"].__setitem__(3, 1), "not within 20"),
        ("robots", lambda s: s["last_windows"].pop(), "zip"),
        ("robots", lambda s: s.update(reward_moments=[0.0, 1.0, 1.0]), "unlike the run"),
        ("flock", lambda s: s.update(reward_moments=None), "unlike the run"),
        ("flock", lambda s: s["reward_moments"].__setitem__(1, -1.0), "Expected `float` >= 0.0"),
        ("flock", lambda s: s["reward_moments"].__setitem__(0, math.nan), "`float` >= -1e"),
        ("flock", lambda s: s["returns"].fill_(math.inf), "returns has numbers"),
    ],
)
def test_what_is_not_the_run_s_is_refused_before_anything_changes(states, whose, change, complaint):
    sound, model = states[whose]
    state, before = copy.deepcopy(sound), copy.deepcopy(model.policy.state_dict())
    change(state)
    with pytest.raises((ValueError, KeyError, TypeError), match=complaint):
        restore(state, model)
    assert not difference(model.policy.state_dict(), before)
