"""Checkpoints: sound ones come back to the last bit; all others are refused and run nothing."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import difference, evaluation, run, small_training

from swarm_mj.learning.checkpoint import load, save
from swarm_mj.learning.ppo import make_model, networks_of
from swarm_mj.learning.run_folder import CHECKPOINT
from swarm_mj.learning.selection import Accumulator, Progress
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures

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
        (1.0, lambda state: state.clear(), r"c.pt is damaged, or another run's \("),
        (1.0, lambda s: s.update(version=99), "another version of swarm_mj wrote it"),
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


def test_one_of_other_features_is_refused_by_their_names(kept, tmp_path, monkeypatch):
    """It would go on, as if the network had learned from what it sees now."""
    names = ExtendedFeatures.names
    monkeypatch.setattr(ExtendedFeatures, "names", (names[1], names[0], *names[2:]))
    with pytest.raises(ValueError, match=r'c\.pt was .*: number 1 of them was "is oneself" and'):
        load_bytes(tmp_path, kept)


def test_progress_comes_back_to_the_last_bit(tmp_path):
    row = evaluation(0, aoi=1 / 3, objective=2 / 3)
    progress = Progress(
        minutes=0.1 + 0.2,
        next_replay=12,
        curve=[row, replace(row, training={"train/explained_variance": math.nan})],
        since_evaluation=Accumulator(seconds=1e-9 / 3, decisions=5, age_windows=0.1),
        optimiser={"train/entropy": 2 / 3},
    )
    model = make_model(TRAINING)
    model._last_episode_starts = np.ones(model.n_envs, dtype=bool)
    save(tmp_path / "c.pt", TRAINING, model, progress, {0: networks_of(model).acting_network()})
    again, networks = load(tmp_path / "c.pt", TRAINING, make_model(TRAINING))
    assert math.isnan(again.curve[1].training.pop("train/explained_variance"))
    progress.curve[1].training.pop("train/explained_variance")
    assert again == progress
    assert not difference(
        networks[0].state_dict(), networks_of(model).acting_network().state_dict()
    )


def test_one_that_would_run_code_does_not(tmp_path):
    class Trap:
        def __reduce__(self):
            return (open, (str(tmp_path / "sprung"), "w"))

    torch.save({"policy": Trap()}, tmp_path / "zipped")
    for content in ((tmp_path / "zipped").read_bytes(), pickle.dumps(Trap())):
        with pytest.raises(ValueError, match="is damaged, or none; begin a new run with another"):
            load_bytes(tmp_path, content)
    assert not (tmp_path / "sprung").exists()


def test_one_that_is_missing_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"checkpoint .* cannot be found"):
        load(tmp_path / "none.pt", TRAINING, make_model(TRAINING))
