"""`swarm-mj train` refuses bad input in one clear line, before anything is written."""

import json

import pytest

from swarm_mj.cli import main

SMALL = (
    *("--robots", "4", "--windows", "12", "--range-ratio", "1", "--missions", "4"),
    *("--latent", "4", "--held-out", "1", "--budget", "1"),
)
REFUSED = {
    "": "the following arguments are required: --out",
    "NEW --credit both": "credit must be one of robot, team, not 'both'",
    "NEW --reward velocity-variance": "choose credit team, or reward aoi",
    "NEW --credit team --reward velocity-variance": "only if the robots flock; add --task flocking",
    "NEW --robots 10 201": "robots must be a whole number from 2 to 200, not 201",
    "NEW --robots many": "argument --robots: name a whole number",
    "NEW --range-ratio 0.02": "too sparse",
    "NEW --robots 10 --bit-rate 10k": "94 bytes, but a slot holds 62 bytes at 10 kbit/s; choose",
    "NEW --missions 16 --robots 4 5 6": "of the 3 kinds (team sizes by missions), not 16",
    "NEW --range-ratio 0.5 1 --missions 3": "of the 2 kinds (team sizes by missions), not 3",
    "NEW --credit-scaling all": "credit-scaling must be one of none, kind, not 'all'",
    "NEW --credit team --preset paper reference": "credit team takes one preset, not paper and",
    "NEW --credit team --reward velocity-variance --task flocking stationary": "robots flock",
    "NEW --range-ratio 0.5 0.02": "too sparse",
    "NEW --train-windows 200 100": "one number, or the least and the most: 200 100",
    "NEW --most-speech 0": "most-speech must be a number from 1e-09 to 1, not 0",
    "NEW --credit team --preset reference --missions 1": "is too small for 4",
    "NEW --missions 4096 --robots 200": "GB of memory, and",
    "NEW --learning-rate 0": "learning rate must be a number from 1e-09 to 1, not 0",
    "NEW --device tpu": "device must be one of auto, cpu, cuda, not 'tpu'",
    "NEW --budget 0": "budget must be a whole number from 1 to 1000000000000, not 0",
    "NEW --policy mlp": "policy must be one of gnn, index-csma, not 'mlp'",
    "NEW --policy index-csma --credit team": "--credit is of training a gnn, not of index-csma",
    "NEW --policy index-csma --latent 8": "--latent is of training a gnn, not of index-csma; leave",
    "NEW --policy index-csma --features turns": "--features is of training a gnn, not of",
    "NEW --policy index-csma --learning-rate 1": "--learning-rate is of training a gnn, not of",
    "NEW --policy index-csma --reward velocity-variance": "--reward is of training a gnn, not of",
    "NEW --policy index-csma --device cpu": "--device is of training a gnn, not of index-csma",
    "NEW --policy index-csma --init done": "--init begins with a gnn, not with an index; leave",
    "NEW --policy index-csma --robots 10 --bit-rate 1k": "bytes for a single entry, but a",
    "NEW --wings 2": "unrecognized arguments: --wings 2",
    "NEW --resume": "new holds no run to go on with; to begin one, leave out --resume",
    "NEW --init nothing": "there is no policy nothing",
    "NEW --init damaged": "damaged/policy.safetensors",
    "NEW --init done --latent 8": "--latent 8 is not what the policy done has, 4; leave it out",
    "NEW --init done --linear": "--linear True is not what the policy",
    "--out done": "done holds checkpoint.pt; go on with a run by --resume, or name another",
    "--out done/checkpoint.pt": "is a file; name a folder",
    "--out done/checkpoint.pt/new": "cannot be written",
    "--out other": "other holds thesis.tex; go on with a run by --resume, or name another",
    "DONE --robots 4 5": "--robots 4 5 is not what the run in done has, 4; leave",
    "DONE --policy index-csma": "--policy index-csma is not what the run in done has, gnn; leave",
    "DONE --init done": "done has begun, so --init done is too late",
    "DONE --budget -1": "budget must be a whole number from 1",
    "--out cut-settings --resume": "settings.json are damaged, no run's, or",
    "--out cut-checkpoint --resume": "checkpoint.pt is damaged, or none; begin a new",
    "--out strange --resume": "run strange/policy.safetensors is a folder; name a file",
    "--out mixed-up --resume": "it was made with other settings than the run's",
}
SHORT = {"NEW": "--out new --budget 1", "DONE": "--out done --resume"}


def prepare(folder):
    """The folders that the refused command lines name, made of those of a finished run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["train", "--out", "done", *SMALL]) == 0
    checkpoint = (folder / "done" / "checkpoint.pt").read_bytes()
    settings = json.loads((folder / "done" / "settings.json").read_text())
    ppo = settings["training"]["ppo"] | {"entropy": 0.125}
    other = settings | {"training": settings["training"] | {"ppo": ppo}}
    made = {
        "other/thesis.tex": b"precious",
        "damaged/policy.safetensors": b"{",
        "cut-settings/settings.json": as_bytes(settings)[:-40],
        "cut-checkpoint/settings.json": as_bytes(settings),
        "cut-checkpoint/checkpoint.pt": checkpoint[:-40],
        "strange/settings.json": as_bytes(settings),
        "strange/checkpoint.pt": checkpoint,
        "strange/policy.safetensors/thesis.tex": b"precious",
        "mixed-up/settings.json": as_bytes(other),
        "mixed-up/checkpoint.pt": checkpoint,
    }
    for name, content in made.items():
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_bytes(content)


def as_bytes(document):
    return json.dumps(document).encode()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("refusals")
    prepare(made)
    return made


@pytest.mark.parametrize("line", REFUSED)
def test_bad_input_is_one_clear_line_and_changes_nothing(forks, folder, line):
    before = stamps(folder)
    words = " ".join(SHORT.get(word, word) for word in line.split(" "))
    done = forks.run(folder, "swarm_mj", "train", *words.split())
    assert (done.returncode, done.stdout) == (2, "")
    assert REFUSED[line] in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert stamps(folder) == before


def stamps(folder):
    return {path: path.is_file() and path.stat().st_mtime_ns for path in folder.rglob("*")}
