"""Checkpoints that are damaged, foreign, of another version or of other settings."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import run, small_training

from swarm_mj.learning.checkpoint import acting_network, load, save
from swarm_mj.learning.checkpoint_state import IN_A_ROW
from swarm_mj.learning.run_folder import CHECKPOINT, Accumulator, Progress
from swarm_mj.learning.train import make_model

TRAINING = small_training()


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """The bytes of a sound checkpoint."""
    folder = tmp_path_factory.mktemp("run")
    run(TRAINING, folder, 32)
    return (folder / CHECKPOINT).read_bytes()


def load_bytes(folder, content, training=TRAINING):
    (folder / "c.pt").write_bytes(content)
    model, rng = make_model(training)
    return load(folder / "c.pt", training, model, rng)[0]


def changed(kept, folder, change):
    """The bytes of a checkpoint after a change of what is in it."""
    (folder / "before.pt").write_bytes(kept)
    state = torch.load(folder / "before.pt", weights_only=True)
    change(state)
    torch.save(state, folder / "after.pt")
    return (folder / "after.pt").read_bytes()


def test_a_sound_one_is_taken(kept, tmp_path):
    assert load_bytes(tmp_path, kept).decisions == 32


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_one_that_was_cut_off_is_refused(kept, tmp_path, share):
    with pytest.raises(ValueError, match=r"c.pt is damaged, or none; begin a new run"):
        load_bytes(tmp_path, kept[: int(share * len(kept))])


def test_one_with_other_bytes_in_its_middle_is_refused(kept, tmp_path):
    middle = len(kept) // 2
    flipped = bytes(255 - byte for byte in kept[middle : middle + 64])
    with pytest.raises(ValueError, match=r"c.pt is damaged"):
        load_bytes(tmp_path, kept[:middle] + flipped + kept[middle + 64 :])


def test_foreign_files_are_refused(tmp_path):
    torch.save({"weights": torch.zeros(3)}, tmp_path / "other.pt")
    for content in (b"what?", (tmp_path / "other.pt").read_bytes()):
        with pytest.raises(ValueError, match=r"c.pt is (damaged, or none|no checkpoint)"):
            load_bytes(tmp_path, content)


def test_a_file_that_would_run_code_does_not(tmp_path):
    class Trap:
        def __reduce__(self):
            return (open, (str(tmp_path / "sprung"), "w"))

    with pytest.raises(ValueError, match=r"c.pt is damaged, or none"):
        load_bytes(tmp_path, pickle.dumps({"version": 1, "policy": Trap()}))
    assert not (tmp_path / "sprung").exists()


def test_another_version_is_refused(kept, tmp_path):
    content = changed(kept, tmp_path, lambda state: state.update(version=99))
    with pytest.raises(ValueError, match=r"version 99, and this swarm_mj reads 3; resume with"):
        load_bytes(tmp_path, content)


def test_other_settings_are_refused(kept, tmp_path):
    other = replace(TRAINING, ppo=replace(TRAINING.ppo, entropy=0.5))
    with pytest.raises(ValueError, match="made with other settings than the run's"):
        load_bytes(tmp_path, kept, other)


@pytest.mark.parametrize(
    "change",
    [
        lambda state: state.pop("parameters"),
        lambda state: state.update(parameters={}),
        lambda state: state.update(histories=[]),
        lambda state: state.update(torch_rng=torch.zeros(3)),
        lambda state: state.update(seeds_rng={}),
        lambda state: state.update(progress={"wings": 2}),
    ],
)
def test_one_that_lacks_something_is_refused_in_one_line(kept, tmp_path, change):
    with pytest.raises(ValueError, match=r"c.pt is damaged, or another run's \(") as caught:
        load_bytes(tmp_path, changed(kept, tmp_path, change))
    assert "\n" not in str(caught.value)


def test_progress_comes_back_to_the_last_bit(tmp_path):
    row = dict.fromkeys(sorted(IN_A_ROW), 1 / 3)
    progress = Progress(
        decisions=7,
        minutes=0.1 + 0.2,
        next_evaluation=12,
        curve=[row, row | {"train/explained_variance": math.nan}],
        since_evaluation=Accumulator(seconds=1e-9 / 3, decisions=5, age_windows=0.1),
        optimiser={"train/entropy": 2 / 3},
    )
    model, rng = make_model(TRAINING)
    model._last_episode_starts = np.ones(model.n_envs, dtype=bool)
    save(tmp_path / "c.pt", TRAINING, model, rng, progress, {0: acting_network(model)})
    again, networks = load(tmp_path / "c.pt", TRAINING, *make_model(TRAINING))
    assert math.isnan(again.curve[1].pop("train/explained_variance"))
    progress.curve[1].pop("train/explained_variance")
    assert again == progress
    kept, own = networks[0].state_dict(), acting_network(model).state_dict()
    assert all(torch.equal(kept[name], own[name]) for name in own)
    assert again.best_objective == math.inf


def test_a_checkpoint_that_cannot_be_written_is_an_os_error(tmp_path):
    model, rng = make_model(TRAINING)
    model._last_episode_starts = np.ones(model.n_envs, dtype=bool)
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        save(tmp_path / "file" / "c.pt", TRAINING, model, rng, Progress(), {})


def test_a_run_does_not_begin_over_another(tmp_path):
    (tmp_path / CHECKPOINT).touch()
    with pytest.raises(ValueError, match=r"holds checkpoint.pt"):
        run(TRAINING, tmp_path, 1)
