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

from swarm_mj.learning.checkpoint import IN_A_ROW, load, restore, save
from swarm_mj.learning.ppo import make_model, policy_of
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
        (1.0, lambda s: s.update(version=99), "version 99, and this swarm_mj reads 5; resume with"),
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
        minutes=0.1 + 0.2,
        next_replay=12,
        curve=[row, row | {"train/explained_variance": math.nan}],
        since_evaluation=Accumulator(seconds=1e-9 / 3, decisions=5, age_windows=0.1),
        optimiser={"train/entropy": 2 / 3},
    )
    model = make_model(TRAINING)
    model._last_episode_starts = np.ones(model.n_envs, dtype=bool)
    save(tmp_path / "c.pt", TRAINING, model, progress, {0: policy_of(model).acting_network()})
    again, networks = load(tmp_path / "c.pt", TRAINING, make_model(TRAINING))
    assert math.isnan(again.curve[1].pop("train/explained_variance"))
    progress.curve[1].pop("train/explained_variance")
    assert again == progress
    assert not difference(networks[0].state_dict(), policy_of(model).acting_network().state_dict())


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


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda state: state.update(normaliser={}), "normaliser must have mean, var, count"),
        (lambda state: state["normaliser"]["var"].fill_(-1.0), "variance, is negative"),
        (lambda state: state["normaliser"]["returns"].fill_(math.inf), "returns has numbers"),
    ],
)
def test_what_normalises_rewards_is_checked(flock, change, complaint):
    """The fault tests craft all other parts of a state."""
    training, kept = flock
    state = copy.deepcopy(kept)
    change(state)
    with pytest.raises(ValueError, match=complaint):
        restore(state, make_model(training))


@pytest.fixture(scope="module")
def flock(tmp_path_factory):
    """Settings of a team whose rewards are normalised, and the state of its run's checkpoint."""
    training = small_training("team", "flocking", reward="velocity-variance")
    folder = tmp_path_factory.mktemp("flock")
    run(training, folder, 32)
    return training, torch.load(folder / CHECKPOINT, weights_only=True)
