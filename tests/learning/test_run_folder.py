"""A run's folder: its settings on disk, what may begin there, what kills leave."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from small_runs import small_training
from tiny_policies import save_tiny

from swarm_mj.learning.run_folder import (
    INIT,
    SETTINGS,
    Limits,
    Run,
    check_new,
    own_init,
    read_run,
    remove_parts,
    write_run,
)

LIMITS = Limits(decisions=5, minutes=0.5, replay_every=3)
RUN = Run(training=small_training(sizes=(4, 6)), limits=LIMITS, command="swarm-mj train --out x")


def changed(folder, change):
    """The settings on disk after a change of their JSON."""
    write_run(folder, RUN)
    document = json.loads((folder / SETTINGS).read_text())
    change(document)
    (folder / SETTINGS).write_text(json.dumps(document))
    return folder


def test_a_run_is_read_as_it_was_written(tmp_path):
    for run in (RUN, replace(RUN, init=tmp_path / "policy", limits=Limits())):
        write_run(tmp_path / "run", run)
        assert read_run(tmp_path / "run") == run


def test_a_policy_is_named_by_its_whole_path(tmp_path, monkeypatch):
    """So that the run can go on from another folder."""
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path, replace(RUN, init=Path("policy")))
    assert read_run(tmp_path).init == tmp_path / "policy"


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "{}", '{"format": "swarm_mj policy"}'])
def test_what_is_no_settings_is_refused(tmp_path, text):
    (tmp_path / SETTINGS).write_text(text)
    with pytest.raises(ValueError, match=r"settings .*settings.json are damaged, or no run's"):
        read_run(tmp_path)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda d: d.update(format_version=2), "format_version is 2, and this swarm_mj reads 1"),
        (lambda d: d["training"].update(seed="3"), "training.seed is '3', which is of another"),
        (lambda d: d["training"].update(missions=True), "training.missions is True"),
        (lambda d: d["training"]["ppo"].update(clip=None), "training.ppo.clip is None"),
        (lambda d: d["training"].update(robots=["4"]), "training.robots is '4'"),
        (lambda d: d["training"].pop("arm"), "arm"),
        (
            lambda d: d["training"]["network"].update(latent=0),
            "latent must be a whole number from 1 to",
        ),
        (lambda d: d["limits"].update(wings=2), "wings"),
        (lambda d: d.pop("command"), "command"),
    ],
)
def test_settings_of_another_kind_are_refused(tmp_path, change, complaint):
    with pytest.raises(ValueError, match=complaint):
        read_run(changed(tmp_path, change))


def test_a_folder_without_a_run_says_how_to_begin_one(tmp_path):
    with pytest.raises(ValueError, match="holds no run to go on with; to begin one, leave out"):
        read_run(tmp_path / "nothing")


def test_runs_begin_in_folders_of_their_own(tmp_path):
    check_new(tmp_path / "new")
    (tmp_path / "empty").mkdir()
    check_new(tmp_path / "empty")
    (tmp_path / "empty" / f".{SETTINGS}.123.part").touch()  # a run killed while it began
    check_new(tmp_path / "empty")
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="file is a file; name a folder"):
        check_new(tmp_path / "file")
    (tmp_path / "empty" / "thesis.tex").touch()
    with pytest.raises(ValueError, match=r"holds thesis.tex, which is no run's"):
        check_new(tmp_path / "empty")
    write_run(tmp_path / "run", RUN)
    with pytest.raises(ValueError, match="holds a run; go on with it by --resume"):
        check_new(tmp_path / "run")


def test_what_killed_sessions_left_is_removed_and_nothing_else(tmp_path):
    write_run(tmp_path, RUN)
    (tmp_path / ".checkpoint.pt.12.part").write_text("half")
    (tmp_path / ".policy.12.part").mkdir()
    (tmp_path / ".policy.12.part" / "config.json").touch()
    (tmp_path / ".policy.old").mkdir()  # may be the only whole version
    (tmp_path / "notes.part").touch()
    remove_parts(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {SETTINGS, ".policy.old", "notes.part"}


def test_a_run_keeps_its_own_copy_of_the_policy_it_begins_with(tmp_path):
    save_tiny(tmp_path / "given")
    own = own_init(tmp_path / "run", tmp_path / "given")
    assert own == tmp_path / "run" / INIT
    before = (own / "model.safetensors").read_bytes()
    save_tiny(tmp_path / "given", seed=2)
    assert own_init(tmp_path / "run", tmp_path / "given") == own
    assert (own / "model.safetensors").read_bytes() == before
