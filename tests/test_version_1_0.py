"""Version 1.0.0's files, options, keys and names in Python still work, as docs/api.md promises.

`golden/v1.0/` has files that 1.0.0 wrote, and lists what it took. What was removed since is in
`REMOVED`, each with the sentence of the changelog that says so.
"""

import importlib
import inspect
import json
import shutil
import sys
import tarfile
from pathlib import Path

import mujoco
import pandas as pd
import pytest
from pyarrow import parquet

import swarm_mj
from swarm_mj.cli import parse
from swarm_mj.cli.study import read_study
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.policies.gnn.feature_sets import FEATURE_SETS
from swarm_mj.policies.stored import read_weights
from swarm_mj.replay.read import check_replay

ROOT = Path(__file__).parent.parent
GOLDEN = ROOT / "tests/golden/v1.0"
SURFACE = json.loads((GOLDEN / "surface.json").read_text())
REMOVED = {
    "features buffer": "The features `buffer`: `turns` have the same information",
    "resumed trainings": "The same command and seed make another policy than before, and a run "
    "that began before cannot go on.",
    "columns of greedy_oracle": "the reference that knows all is `lookahead-oracle`, in place of "
    "`greedy-oracle`: in what a training prints, its curve (`aoi_lookahead_oracle`)",
    "exported replays": "Earlier replays still open and make videos, but cannot be exported.",
    "sensing below the preamble": "-57 dBm by default, in 64 minislots; a lower `--sensing-dbm` is "
    "refused.",
    "study code": "`swarm-mj study run` runs code that a file names, as `module:Name`, only with "
    "`--trust`.",
}
TINY = ("--task", "stationary", "--robots", "4", "--windows", "20", "--range-ratio", "0.6")
STORED = ("gnn", "local", "reference", "sb3-a2c", "sb3-maskableppo", "sb3-ppo")
# What stands for a value in the help, and such a value; a file's name is such a value itself.
SAMPLES = {
    "MODULE:NAME": "own_parts:Lossy",
    "auto|HOST:PORT": "auto",
    "FILE.png|.svg|.pdf": "chart.png",
    "WIDTHxHEIGHT": "640x480",
    "RATE": "250k",
    "POLICY": "tdma",
    "NAME": "tdma",
    "X": "1",
    "N": "1",
}
# What a command needs besides an option, and what an option needs besides itself.
NEEDED = {
    "curves": ["runs/extended"],
    "figures": ["drawn.csv", "--out", "figures"],
    "replay": ["flock.rrd"],
    "study": ["run", "study.toml"],
    "train": ["--out", "runs/new"],
}
# Fields that count only with another one, as 1.0.0 said, too, and that one with a value.
SWITCHES = {
    "antenna_height_m": ("path_loss", "two-ray"),
    "burst_end": ("burst_begin", 0.02),
    "high_power_db": ("high_power_fraction", 0.2),
    "loss_exponent": ("path_loss", "log-distance"),
    "map_offset_m": ("prior_knowledge", "map"),
    "position_noise_s": ("position_noise_m", 1.0),
    "reference_m": ("path_loss", "log-distance"),
    "rician_k": ("fading", "rician"),
    "shadowing_distance_m": ("shadowing_db", 3.0),
}
TOGETHER = {"collide": ("physics", "contact"), "reward": ("credit", "team")}


def test_what_was_removed_is_in_the_changelog():
    """Its sentences are of the versions after 1.0.0."""
    text = (ROOT / "CHANGELOG.md").read_text().partition("\n## 1.0.0 ")[0]
    since = " ".join(text.split())
    for sentence in REMOVED.values():
        assert sentence in since


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """A folder with the files, which tests only read."""
    folder = tmp_path_factory.mktemp("v1.0")
    with tarfile.open(GOLDEN / "files.tar.xz") as packed:
        packed.extractall(folder, filter="data")
    for path in GOLDEN.iterdir():
        shutil.copy(path, folder)
    return folder


@pytest.fixture
def files(unpacked, tmp_path, monkeypatch):
    """A copy of that folder, and this process in it."""
    folder = shutil.copytree(unpacked, tmp_path / "v1.0")
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    yield folder
    sys.modules.pop("own_parts", None)  # or it would be that of tests to come


@pytest.fixture
def succeed(forks, files):
    """Runs `swarm-mj` among the files, with exit code 0; returns what it printed."""

    def run(*arguments):
        done = forks.run(files, "swarm_mj", *arguments)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


@pytest.fixture
def refusal(forks, files):
    """Runs what is refused in one line; returns the line."""

    def run(*arguments):
        done = forks.run(files, "swarm_mj", *arguments)
        assert (done.returncode, done.stdout) == (2, ""), done.stderr
        (line,) = done.stderr.strip().splitlines()
        return line

    return run


def typed_values(option):
    """Values of an option, as they are typed; none of a flag."""
    if option["metavar"] is None:
        return [None]
    metavar = option["metavar"]
    if option["flags"] == ["--sensing-dbm"]:
        return ["-50"]  # the least that 1.0.0 took is refused now, as REMOVED says
    return option["values"] or [SAMPLES.get(metavar, metavar)]


def switched_on(flag):
    """The option that another one counts with, and its value; nothing for most."""
    name = flag.removeprefix("--").replace("-", "_")
    if name not in SWITCHES | TOGETHER:
        return []
    switch, state = (SWITCHES | TOGETHER)[name]
    return ["--" + switch.replace("_", "-"), str(state)]


@pytest.mark.parametrize("command", SURFACE["commands"])
def test_each_option_is_taken_by_each_of_its_names_with_each_choice(files, command):  # noqa: ARG001
    for option in SURFACE["commands"][command]:
        for flag in option["flags"]:
            for value in typed_values(option):
                given = [flag] if value is None else [flag, value]
                parse([command, *NEEDED.get(command, []), *switched_on(option["flags"][0]), *given])


def test_sensing_that_1_0_took_is_refused_by_a_way_out():
    with pytest.raises(ValueError, match=r"must be at least -57 dBm.*choose that or more"):
        swarm_mj.paper("stationary", sensing_dbm=-90.0)


def test_each_feature_set_and_policy_is_still_there():
    lacking = set(SURFACE["features"]) - set(FEATURE_SETS)
    assert lacking == {"buffer"}  # as REMOVED says
    mission = swarm_mj.paper("stationary", num_robots=4)
    for name in SURFACE["policies"]:
        swarm_mj.make_policy(name, mission)


def test_each_field_of_a_mission_is_taken():
    fields = SURFACE["mission"]
    mission = swarm_mj.Mission(**fields)
    for name, value in fields.items():
        assert getattr(mission, name) == value


def test_each_key_of_a_study_is_taken(files):
    keys = {
        "policies": '["own.safetensors"]',
        "episodes": "2",
        "seed": "2000",
        "is_deterministic": "true",
        "features": '["own_parts:Ages"]',
        "baseline": '"own.safetensors"',
    }
    study = files / "keys.toml"
    lines = [f"{key} = {value}" for key, value in keys.items()]
    for name, value in SURFACE["mission"].items():
        if value is None:
            continue
        mission = [f"{name} = {json.dumps(value)}"]
        if name in SWITCHES:
            switch, state = SWITCHES[name]
            mission.append(f"{switch} = {json.dumps(state)}")
        study.write_text("\n".join(["[study]", *lines, "[mission]", *mission]))
        read_study("keys.toml", is_trusted=True)
    study.write_text('[study]\npolicies = ["aloha"]\nprobability = 0.2\n')
    read_study("keys.toml")
    # 1.0.0 wrote regimes as [missions.NAME]; study.toml has components.
    assert set(SURFACE["study"]) == {*keys, "probability", "components", "regimes"}


def resolved(name):
    """The thing of a dotted name."""
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def check_arguments(name, thing, former):
    """Fails unless a function takes the arguments that it took, by place or as keywords."""
    if not former:
        return
    parameters = inspect.signature(thing).parameters.values()
    takes_any = any(each.kind is inspect.Parameter.VAR_KEYWORD for each in parameters)
    names = [each.name for each in parameters if each.name != "self"]
    by_place = [each for each in former if not each.startswith("*")]
    assert names[: len(by_place)] == by_place, name
    for each in former[len(by_place) :]:
        assert takes_any or each.removeprefix("*") in names, f"{name}({each})"


@pytest.mark.parametrize("name", SURFACE["python"])
def test_each_public_name_is_still_there_with_its_arguments(name):
    thing = resolved(name)
    former = SURFACE["python"][name]
    check_arguments(name, thing, former["arguments"])
    for method, arguments in former.get("methods", {}).items():
        check_arguments(f"{name}.{method}", getattr(thing, method), arguments)
    declared = {}
    for base in getattr(thing, "__mro__", ()):
        declared |= inspect.get_annotations(base)
    for each in former.get("attributes", ()):
        assert each in declared or hasattr(thing, each), f"{name}.{each}"


def key_paths(value, path=""):
    """All keys of a value from JSON, each by its path; the values in lists count as one."""
    if isinstance(value, list):
        for each in value:
            yield from key_paths(each, path)
    elif isinstance(value, dict):
        for key, each in value.items():
            yield f"{path}/{key}"
            yield from key_paths(each, f"{path}/{key}")


def lacking_keys(before, after):
    """Keys of a JSON file that another lacks."""
    texts = [path.read_text() for path in (before, after)]
    former, present = (set(key_paths(json.loads(text))) for text in texts)
    return former - present


def lacking_columns(before, after):
    """Columns of a CSV file that another lacks."""
    return set(pd.read_csv(before).columns) - set(pd.read_csv(after).columns)


def test_results_have_the_keys_and_columns_that_they_had(succeed, files):
    policies = ("--policy", "tdma", "mst")
    missions = ("--task", "stationary", "flocking", "--robots", "5", "--range-ratio", "0.6")
    outputs = ("--json", "now.json", "--csv", "now.csv")
    succeed("evaluate", *policies, *missions, "--windows", "20", "--episodes", "2", *outputs)
    assert not lacking_keys(files / "evaluation.json", files / "now.json")
    assert not lacking_columns(files / "evaluation.csv", files / "now.csv")


def test_a_flights_summary_has_the_keys_that_it_had(succeed, files):
    mission = ("--robots", "5", "--windows", "20")
    succeed("fly", "--policy", "planner", *mission, "--no-record", "--json", "now.json")
    assert not lacking_keys(files / "flight.json", files / "now.json")


def test_lists_as_json_have_the_keys_that_they_had(succeed):
    said = json.loads(succeed("policies", "planner", "--json"))
    assert set(SURFACE["policies --json"]) <= set(said)


@pytest.mark.slow
def test_the_doctors_findings_have_the_keys_that_they_had(forks, files):
    done = forks.run(files, "swarm_mj", "doctor", "--json")  # may find something broken
    assert set(SURFACE["doctor --json"]) <= set(json.loads(done.stdout)["findings"][0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "name"),
    [
        ("--missions 1 --seconds 0.1 --episodes 0 --no-learning", "bench.json"),
        ("--robots 4 6 --seconds 0.1", "bench-teams.json"),
    ],
)
def test_measured_times_have_the_keys_that_they_had(succeed, files, options, name):
    succeed("bench", *options.split(), "--json", "now.json")
    assert not lacking_keys(files / name, files / "now.json")


@pytest.mark.parametrize("name", ["evaluation", "study", "paper", "drawn"])
def test_results_are_read(files, name):
    assert read_results(files / f"{name}.csv")


def test_results_are_drawn(succeed, files):
    succeed("figures", "drawn.csv", "--out", "figures", "--figure", "fig4", "--format", "svg")
    assert (files / "figures/fig4.svg").exists()


def test_a_study_that_names_code_asks_for_trust_and_says_how(refusal):
    assert "if you trust that code, give --trust" in refusal("study", "run", "study.toml")


@pytest.mark.slow
def test_a_study_is_flown_and_compared_with_what_it_was(succeed, files):
    outputs = ("--json", "now.json", "--csv", "now.csv", "--parquet", "now.parquet")
    succeed("study", "run", "study.toml", "--trust", *outputs)
    assert not lacking_keys(files / "study.json", files / "now.json")
    assert not lacking_columns(files / "study.csv", files / "now.csv")
    before, after = (parquet.read_schema(f"{name}.parquet") for name in ("study", "now"))
    assert set(before.names) <= set(after.names)
    assert set(before.metadata) <= set(after.metadata)
    said = succeed("study", "compare", "study.parquet", "now.parquet")
    compared = [line for line in said.splitlines() if "own_parts:AskTheStalest" in line]
    assert compared
    for line in compared:
        assert line.split()[-3:] == ["2", "0", "0"]  # both have the same missions


def test_a_begun_evaluation_says_which_version_began_it(refusal):
    """As in 1.0.0, only the very code that flew the first missions flies the others."""
    line = refusal("study", "run", "paper.toml", "--csv", "begun.csv", "--resume")
    assert "its version is '1.0.0', not" in line
    assert "start over with --force" in line


@pytest.mark.parametrize("name", STORED)
def test_a_stored_policy_flies(succeed, name):
    said = succeed("fly", "--policy", f"{name}.safetensors", *TINY, "--no-record")
    assert "age of information" in said


def test_a_stored_policy_of_own_features_flies_with_them(succeed):
    own = ("--policy", "own.safetensors", "--features", "own_parts:Ages")
    succeed("fly", *own, *TINY, "--no-record")


def test_a_policy_of_buffer_features_is_refused_by_a_way_out(refusal):
    line = refusal("fly", "--policy", "buffer.safetensors", *TINY, "--no-record")
    assert "fly the policy with the version that made it, or train another" in line


def test_own_parts_fly_as_they_were_written(succeed):
    fly = ("fly", "--robots", "5", "--windows", "20", "--no-record")
    succeed(*fly, "--policy", "own_parts:Csma", "--channel", "own_parts:Lossy")
    own = ("--controller", "own_parts:Gather", "--scene", "own_parts:wall")
    succeed(*fly, "--task", "random-walk", "--physics", "contact", *own)
    succeed(*fly, "--task", "random-walk", "--arena", "arena.xml")
    succeed(*fly, "--channel", "table:gains.csv")


@pytest.mark.parametrize("name", ["extended", "paper"])
def test_a_runs_policy_flies_and_its_curve_is_shown(succeed, files, name):
    run = f"runs/{name}"
    succeed("fly", "--policy", run, *TINY, "--no-record")
    assert "greedy-oracle" in succeed("curves", run, "--plot", "curve.svg", "--csv", "curve.csv")
    assert (files / "curve.svg").exists()


@pytest.mark.parametrize("name", ["extended", "paper"])
def test_a_run_of_1_0_cannot_go_on_but_says_how_its_policy_can(refusal, name):
    run = f"runs/{name}"
    line = refusal("train", "--out", run, "--resume", "--budget", "512")
    assert f"--init {run} --features {name}" in line


@pytest.mark.slow
@pytest.mark.parametrize(("name", "credit"), [("extended", "robot"), ("paper", "team")])
def test_a_runs_policy_is_trained_on(succeed, files, name, credit):
    begun = f"--init runs/{name} --features {name} --credit {credit} --missions 4".split()
    shape = ("--latent", "4", "--depth", "1", "--receptive-field", "1")
    stops = ("--held-out", "2", "--evaluate-every", "128", "--budget", "256")
    succeed("train", "--out", "runs/new", *begun, *shape, *stops, *TINY)
    now = files / "runs/new/curve.csv"
    lacking = lacking_columns(files / f"runs/{name}/curve.csv", now)
    assert lacking == {"aoi_greedy_oracle", "velocity_variance_greedy_oracle"}  # as REMOVED says
    weights, config = read_weights(files / "runs/new/policy.safetensors")
    assert weights
    assert config.features == name


@pytest.mark.parametrize("name", ["city", "flock"])
def test_a_replay_is_opened_and_drawn(succeed, files, name):
    check_replay(files / f"{name}.rrd")
    succeed("replay", f"{name}.rrd", "--picture", "window.svg", "--window", "3")
    assert (files / "window.svg").exists()


@pytest.mark.slow
def test_a_replay_makes_a_video(succeed, files, opengl):  # noqa: ARG001
    video = ("--video", "city.gif", "--seconds", "0.3", "--size", "160x160")
    succeed("replay", "city.rrd", *video)
    assert (files / "city.gif").exists()


def test_a_replay_that_cannot_be_exported_says_what_to_do(refusal):
    assert "record it again" in refusal("export", "flock.rrd", "--to", "csv")


def test_a_missions_scene_is_compiled_by_mujoco(files):
    model = mujoco.MjModel.from_xml_path(str(files / "scene.xml"))
    for robot in range(5):
        assert model.body(f"r{robot}/body").id
