"""Runs that go on: from what is theirs, or not at all, and one process at a time."""

import json
import os
import shutil
from dataclasses import asdict

import pytest
import torch
from damage import complaint, damaged, told_or_read
from small_runs import run, small_training
from tiny_policies import save_tiny

from swarm_mj.cli import main
from swarm_mj.evaluation import flying
from swarm_mj.evaluation.batch import fly_batch
from swarm_mj.evaluation.study import Study
from swarm_mj.learning import checkpoint
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.run_folder import CHECKPOINT, SETTINGS, read_run
from swarm_mj.mission import paper
from swarm_mj.system.writing import owned

EVALUATE = ["evaluate", "--policy", "tdma", "--robots", "3", "--windows", "2", "--episodes", "30"]


@pytest.fixture
def evaluate(tmp_path):
    """Evaluates two batches of missions into one file, from a seed."""
    path = str(tmp_path / "o.csv")
    return lambda seed, *more: main([*EVALUATE, "--seed", str(seed), "--csv", path, *more])


@pytest.fixture
def interrupted(evaluate, tmp_path, monkeypatch):
    """The progress of an evaluation from a seed that was broken off after its first batch."""

    def append_and_stop(*batch):
        append(*batch)
        raise KeyboardInterrupt

    append, path = flying.append_progress, tmp_path / "o.csv.progress"

    def interrupt(seed):
        with monkeypatch.context() as patch:
            patch.setattr(flying, "append_progress", append_and_stop)
            assert evaluate(seed, "--force") == 130
        return path.read_bytes()

    return interrupt


@pytest.mark.fault("one output, one process")
def test_a_second_evaluation_of_one_output_is_refused(evaluate, tmp_path, capsys):
    """Fault 9: both wrote into one progress file."""
    for more in ((), ("--force",), ("--resume",)):
        with owned(tmp_path / "o.csv"):
            said = complaint(capsys, evaluate(1000, *more))
        assert f"o.csv is being written by process {os.getpid()}" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.fault("what is resumed is one's own")
def test_progress_of_two_evaluations_is_refused(evaluate, interrupted, tmp_path, capsys):
    """Fault 9: what of other seeds got into a progress file was taken for its own."""
    other, mine = interrupted(2000).splitlines(keepends=True)[1], interrupted(1000)
    capsys.readouterr()
    path = tmp_path / "o.csv.progress"
    path.write_bytes(mine + other)
    assert "is damaged" in complaint(capsys, evaluate(1000, "--resume"))
    assert path.read_bytes() == mine + other
    path.write_bytes(mine)
    assert "its seed is 1000, not 2000" in complaint(capsys, evaluate(2000, "--resume"))
    assert evaluate(1000, "--resume") == 0


@pytest.mark.fault("damaged files are told")
def test_damaged_progress_is_told_or_dropped(tmp_path, tries):
    """Fault 14, and more: a flip in a number was taken for another cost."""
    path = tmp_path / "progress"
    study = Study(policies=("tdma",), regimes=(paper(num_robots=3, num_windows=2),), episodes=30)
    header = study.header()
    flying.start_progress(path, header)
    for index, batch in enumerate(study.batches):
        flying.append_progress(path, header, index, fly_batch(batch))

    def resume():
        resumed = flying.resume_progress(path, header)
        return {
            i: [each.tobytes() for each in vars(costs).values()] for i, costs in resumed.items()
        }

    flown = resume()
    for content in damaged(path, tries):
        resumed = told_or_read(resume)
        assert resumed is None or resumed.items() <= flown.items()
        assert resumed is not None or path.read_bytes() == content


CRAFTED = [
    "[" * 10**6,
    '{"a":' * 10**6,
    "NaN\n",
    '{"version": NaN}\n',
    "\0\n" * 1000,
    "x\n" * 10**6,
]


@pytest.mark.slow
@pytest.mark.fault("crafted files are refused")
@pytest.mark.parametrize("content", [*CRAFTED, "a pipe"])
def test_crafted_progress_is_refused(evaluate, tmp_path, capsys, content):
    """Fault 14: RecursionError, NaN; a pipe was waited for."""
    path = tmp_path / "o.csv.progress"
    os.mkfifo(path) if content == "a pipe" else path.write_text(content)
    assert "progress" in complaint(capsys, evaluate(1000, "--resume"))
    assert path.exists()
    assert not (tmp_path / "o.csv").exists()


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run of a few seconds, to copy."""
    folder = tmp_path_factory.mktemp("run") / "run"
    run(small_training(), folder, 64)
    return folder


@pytest.fixture
def begun(trained, tmp_path):
    """A copy of a run."""
    return shutil.copytree(trained, tmp_path / "run")


def contents(folder):
    """All that is under a folder, by name."""
    paths = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    return {p: p.read_bytes() if p.is_file() else os.lstat(p).st_mtime_ns for p in paths}


def resume(folder):
    return main(["train", "--out", str(folder), "--resume", "--budget", "96"])


def refused(folder, capsys, *words):
    """Passes if a run is refused in one line with these words, and nothing of it is touched."""
    before = contents(folder)
    said = complaint(capsys, resume(folder))
    assert all(word in said for word in words), said
    assert contents(folder) == before


@pytest.mark.fault("what is resumed is one's own")
@pytest.mark.parametrize("link", [None, "nowhere", "../elsewhere.pt"])
def test_a_run_without_its_checkpoint_does_not_start_over(begun, capsys, link):
    """Fault 3: it replaced the policy that it had trained."""
    (begun / CHECKPOINT).unlink()
    if link:
        (begun / CHECKPOINT).symlink_to(link)
    refused(begun, capsys, CHECKPOINT, "link" if link == "../elsewhere.pt" else "begin another run")


@pytest.mark.fault("one output, one process")
def test_a_second_training_of_one_run_is_refused(begun, capsys):
    with owned(begun / SETTINGS):
        refused(begun, capsys, f"is being written by process {os.getpid()}")


@pytest.mark.fault("crafted files are refused")
@pytest.mark.parametrize("name", ["policy", "curve.csv", "replays", "settings.json"])
def test_a_run_is_not_written_through_links(begun, tmp_path, capsys, name):
    """Fault 7, and more: a run from elsewhere would have others' files replaced."""
    shutil.move(begun / name, tmp_path / "mine") if (begun / name).exists() else None
    (begun / name).symlink_to(tmp_path / "mine")
    refused(begun, capsys, name, "is a link that leads out")


def begin_with(folder, init):
    """Makes of a run one that has begun with a policy and was killed at once."""
    for name in (CHECKPOINT, "curve.csv", "policy.safetensors"):
        (folder / name).unlink()
    settings = json.loads((folder / SETTINGS).read_text())
    (folder / SETTINGS).write_text(json.dumps(settings | {"init": str(init)}))


@pytest.mark.fault("crafted files are refused")
def test_the_policy_a_run_begins_with_is_a_policy_and_no_other_folder(begun, tmp_path, capsys):
    """Fault 7: the folder was copied with all that its links led to, then refused."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "secret").write_text("x")
    begin_with(begun, home)
    refused(begun, capsys, "there is no policy")
    save_tiny(home / "policy.safetensors")
    refused(begun, capsys, "has another network than the run")
    (tmp_path / "mine").write_text("a secret")
    (home / "policy.safetensors").unlink()
    (home / "policy.safetensors").symlink_to(tmp_path / "mine")
    refused(begun, capsys, "it is damaged, or no safetensors file")


PPO = [
    *({"num_steps": value} for value in (0, -1, 10**9, 2.5, "8", None, True)),
    *({"num_minibatches": value} for value in (0, 10**9)),
    *({"num_epochs": value} for value in (0, 10**9)),
    *({name: 1e300} for name in ("clip", "value", "gae_lambda", "decay", "adam_epsilon")),
    *({name: -1.0} for name in ("clip", "value", "gae_lambda", "decay", "adam_epsilon")),
    {"decay_steps": 0},
    {"wings": 2},
]
TRAINING = [
    *({"robots": value} for value in ([], [4, 10**9])),
    *({"groups": value} for value in (0, 3)),
    *({"features": "all"}, {"silence_logit": 1e300}, {"missions": 0}, {"threads": 10**9}),
    *({"mission": None}, {"network": {}}),
]
NETWORK = [{"num_features": 7}, {"num_outputs": 9}, {"latent": 10**9}, {"edges": "none"}]
MISSION = [{"num_robots": 10**9}, {"task": "swim"}, {"range_ratio": 0.0}, {"num_windows": 10**9}]
LIMITS = [
    *({"decisions": value} for value in (0, 1.5)),
    *({"minutes": value} for value in (-1.0, "inf")),
    *({"checkpoint_every_s": -1.0}, {"replay_every": 0}),
]
WHOLE = [{"init": 5}, {"init": "\0"}, {"command": []}, {"format_version": 3}, {"training": []}]


@pytest.mark.slow
@pytest.mark.fault("crafted files are refused")
@pytest.mark.parametrize("is_new", [True, False])
def test_crafted_settings_are_refused(begun, capsys, record_property, is_new):
    """Fault 22: some were noticed when half the run was rewritten, some never."""
    if is_new:
        begin_with(begun, "nothing")
    sound = json.loads((begun / SETTINGS).read_text()) | {"init": None}
    parts = {
        ("training", "ppo"): PPO,
        ("training",): TRAINING,
        ("training", "network"): NETWORK,
        ("training", "mission"): MISSION,
        ("limits",): LIMITS,
        (): WHOLE,
    }
    changes = [(place, change) for place, its in parts.items() for change in its]
    if "SWARM_MJ_TRIES" not in os.environ:
        changes = changes[int(is_new) :: 3]  # half a second each; `make attack` tries all
    for place, change in changes:
        document = json.loads(json.dumps(sound))
        part = document
        for name in place:
            part = part[name]
        part.update(change)
        (begun / SETTINGS).write_text(json.dumps(document))
        refused(begun, capsys)
    record_property("tries", len(changes))


@pytest.mark.fault("crafted files are refused")
@pytest.mark.parametrize("name", [SETTINGS, CHECKPOINT])
def test_a_pipe_is_not_waited_for(begun, capsys, name):
    """Fault 22."""
    (begun / name).unlink()
    os.mkfifo(begun / name)
    refused(begun, capsys, "pipe")


CRAFTED_STATES = [
    lambda s: s.clear(),
    lambda s: s.update(weights={}, adam={}),
    lambda s: s["candidates"].popitem(),
    lambda s: s["last_windows"].__setitem__(3, 1),
    lambda s: s["last_windows"].pop(),
    lambda s: s["seeds"].__setitem__(0, [-1]),
    lambda s: s.update(seeds=None),
    lambda s: s["recipients"][3].fill_(99),
    lambda s: s["recipients"].update({3: torch.zeros(1).expand(10**9)}),
    lambda s: s.update(torch_rng=torch.zeros(5056, dtype=torch.uint8)),
    lambda s: s["numpy_rng"][1].pop(),
    lambda s: s["seeds_rng"]["state"].update(state=-1),
    lambda s: s["seeds_rng"].update(bit_generator="MT19937"),
    lambda s: s.update(progress=None),
    lambda s: s["progress"].update(curve=[{}]),
    lambda s: s["progress"].update(next_replay=None),
    lambda s: s["progress"].update(wings=2),
    lambda s: s["progress"]["curve"][0].update(aoi="1"),
    lambda s: s["progress"].update(optimiser={"train/entropy": "high"}),
]


@pytest.mark.slow
@pytest.mark.fault("crafted files are refused")
def test_crafted_checkpoints_are_refused(begun, capsys, record_property):
    """Fault 22: some were noticed when the settings and the curve were rewritten."""
    sound = (begun / CHECKPOINT).read_bytes()
    for change in CRAFTED_STATES:
        (begun / CHECKPOINT).write_bytes(sound)
        state = torch.load(begun / CHECKPOINT, weights_only=True)
        change(state)
        torch.save(state, begun / CHECKPOINT)
        refused(begun, capsys, "checkpoint")
    record_property("tries", len(CRAFTED_STATES))


@pytest.mark.slow
@pytest.mark.fault("damaged files are told")
def test_damaged_checkpoints_are_told_or_whole(begun, tries):
    """Fault 22: of a zip file's bits, those that say when it was made mean nothing."""
    path, training = begun / CHECKPOINT, small_training()
    model = make_model(training)
    progress, _ = checkpoint.load(path, training, model)
    for _ in damaged(path, tries):
        read = told_or_read(lambda: checkpoint.load(path, training, model)[0])
        assert read is None or asdict(read) == asdict(progress)


@pytest.mark.fault("damaged files are told")
def test_damaged_settings_are_told_or_sound(begun, tries):
    """Fault 22."""
    for _ in damaged(begun / SETTINGS, tries):
        told_or_read(lambda: read_run(begun))
