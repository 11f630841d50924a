"""`swarm-mj study`: files that are studies, and results that are compared."""

import json
from pathlib import Path

import pandas as pd
import pytest

from swarm_mj.cli import parse
from swarm_mj.cli.study import flown_by, read_study
from swarm_mj.mission import paper, reference
from swarm_mj.policies.registry import POLICIES
from swarm_mj.system.packages import asset

ROOT = Path(__file__).parents[2]
SMALL = "[study]\npolicies = ['mst', 'round-robin']\nepisodes = 2\n"
MISSION = "[mission]\nnum_robots = 5\nnum_windows = 12\nrange_ratio = 1\n"
OPTIONS = "--policy mst round-robin --episodes 2 --robots 5 --windows 12 --range-ratio 1"


@pytest.fixture
def read(tmp_path):
    """Reads a study from its text."""

    def reading(text):
        (tmp_path / "s.toml").write_text(text)
        return read_study(str(tmp_path / "s.toml"))

    return reading


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("", ""),
        ("bit_rate = 250e3\n", "--bit-rate 250k"),
        ("task = ['stationary', 'random-walk']\nerasure = [0, 0.1]\n",
         "--task stationary random-walk --erasure 0 0.1"),
        ("task = 'random-walk'\npreset = 'reference'\n", "--task random-walk --preset reference"),
        ("preset = 'urban'\nrician_k = 3\n", "--preset urban --rician-k 3"),
    ],
)  # fmt: skip
def test_a_file_is_the_study_of_the_same_options(read, text, options):
    typed = f"{OPTIONS} {options}"
    from_options = parse(["evaluate", *typed.split()])[1].study
    from_file = read(SMALL + MISSION + text)
    assert from_file == from_options
    assert json.dumps(from_file.header()) == json.dumps(from_options.header())


def test_results_are_byte_for_byte_those_of_the_same_options(succeed, tmp_path):
    (tmp_path / "s.toml").write_text(SMALL + MISSION + "erasure = [0.1, 0.3]\n")
    ran = succeed("study", "run", "s.toml", "--csv", "run.csv", "--json", "run.json")
    evaluated = succeed(
        "evaluate",
        *OPTIONS.split(),
        "--erasure",
        0.1,
        0.3,
        "--csv",
        "e.csv",
        "--json",
        "e.json",
    )
    # They differ in the names of the files that were written alone.
    assert ran.stdout.replace("Wrote run.", "Wrote e.") == evaluated.stdout
    for ending in ("csv", "json"):
        assert (tmp_path / f"run.{ending}").read_bytes() == (tmp_path / f"e.{ending}").read_bytes()


def test_an_empty_file_is_the_default_evaluation(read):
    assert read("") == parse(["evaluate"])[1].study


def test_tables_of_missions_follow_each_other_and_override_what_they_share(read):
    study = read(
        "[mission]\ntask = 'stationary'\nnum_robots = [5, 6]\n"
        "[missions.none]\n[missions.loss]\nerasure = 0.1\nnum_robots = 7\n[missions.again]\n"
    )
    assert study.regimes == (
        paper("stationary", num_robots=5),
        paper("stationary", num_robots=6),
        paper("stationary", num_robots=7, erasure=0.1),
    )


def test_fields_that_are_no_options_can_be_set_and_swept(read):
    regimes = read("[mission]\npreset = 'reference'\nmax_acceleration_mps2 = [5, 10]\n").regimes
    assert regimes == tuple(reference(max_acceleration_mps2=x) for x in (5.0, 10.0))


def test_other_policies_may_fly_a_studys_missions(succeed, refusal, tmp_path):
    (tmp_path / "s.toml").write_text(SMALL + MISSION)
    succeed("study", "run", "s.toml", "--policy", "tdma", "aloha", "--parquet", "other.parquet")
    assert list(pd.read_parquet(tmp_path / "other.parquet")["policy"]) == [
        *["tdma"] * 2,
        *["aloha"] * 2,
    ]
    refused = refusal("study", "run", "s.toml", "--policy", "tmda")
    assert "did you mean tdma?" in refused


def test_other_policies_are_compared_with_the_studys_baseline_if_they_have_it(read):
    study = read(SMALL + "baseline = 'round-robin'\n" + MISSION)
    assert flown_by(study, ["mst", "round-robin", "tdma"]).compared_to == "round-robin"
    assert flown_by(study, ["mst", "tdma"]).compared_to == "mst"


def test_all_is_every_policy(read):
    assert read("[study]\npolicies = 'all'\n").policies == tuple(POLICIES)


REFUSED = {
    "[mission]\nrobots = 5": "[mission] got an unexpected keyword argument 'robots'; "
    "did you mean num_robots?",
    "[missions.a]\nerasur = 0.1": "[missions.a] got an unexpected keyword argument 'erasur'; "
    "did you mean erasure?",
    "[studi]": "did you mean study?",
    "[study]\nepisode = 3": "did you mean episodes?",
    "[study]\nepisodes = [3, 4]": "episodes must be a whole number from 1 to 100000, not (3, 4)",
    "[study]\nbaseline = 'mst'\npolicies = ['tdma']": "add it to them",
    "[study]\npolicies = ['tdm']": "did you mean tdma?",
    "[missions.a]\nnum_robots = [5, 1]": "[missions.a]: number of robots must be a whole number "
    "from 2 to 10000 [robots], not 1",
    "[mission]\ntask = 'flok'": "not 'flok'; did you mean flocking?",
    "[mission]\nnum_robots = '5'": "number of robots must be a whole number",
    "[mission]\nburst_end = 0.1": "burst_end counts only with burst_begin above 0; give that too, "
    "or leave burst_end out",
    "mission = 3": "[mission] must be of the type dict",
    "[missions]": "at least 1 policy and 1 regime",
    "missions = 3": "[missions] must be of the type dict, such as tables, [missions.NAME], not 3",
    "missions = []": "[missions] must be of the type dict",
    "[[missions]]": "[missions] must be of the type dict",
    "[missions]\na = 3": "[missions.a] must be of the type dict",
    "[study]\npolicies = 3": 'policies must be of the type tuple, such as ["tdma", "mst"], not 3',
    "[study]\npolicies = [3]": 'each policy must be of the type str, such as "tdma", not 3',
    "[study]\ncomponents = 3": "[study.components] must be of the type dict",
    "[study.components]\nchannel = 3": "[study.components] channel must be of the type str",
    "[study.components]\nchanel = 'a:b'": "did you mean channel?",
    "[mission": "study s.toml: Expected ']'",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_no_study_may_say_is_refused_in_a_line_that_names_the_file(refusal, tmp_path, text):
    (tmp_path / "s.toml").write_text(text)
    line = refusal("study", "run", "s.toml")
    assert line.startswith("swarm-mj: error: study s.toml: ")
    assert REFUSED[text] in line


@pytest.mark.parametrize("text", ["a = " + "[" * 50_000, "a = " + "{a = " * 50_000])
def test_a_file_that_is_nested_deep_is_refused(refusal, tmp_path, text):
    (tmp_path / "s.toml").write_text(text)
    assert "study s.toml: it is nested too deep" in refusal("study", "run", "s.toml")


EVIL = {  # where a study may name code
    "policy": "policies = ['evil:Mine']",
    "features": "policies = ['gnn']\nfeatures = 'evil:Mine'",
    "channel": "policies = ['tdma']\ncomponents.channel = 'evil:Mine'",
    "controller": "policies = ['tdma']\ncomponents.controller = 'evil:Mine'",
    "scene": "policies = ['tdma']\ncomponents.scene = 'evil:Mine'",
}
BRIEF = "[mission]\nnum_robots = 3\nnum_windows = 2\n[study]\nepisodes = 1\n"


@pytest.mark.parametrize("kind", EVIL)
def test_code_that_a_file_names_is_run_only_if_it_is_trusted(refusal, swarm_mj, tmp_path, kind):
    (tmp_path / "evil.py").write_text("open('sprung', 'w').write('run')\nMine = None\n")
    (tmp_path / "s.toml").write_text(BRIEF + EVIL[kind])
    said = refusal("study", "run", "s.toml")
    assert said.startswith("swarm-mj: error: study s.toml: it runs someone's own evil:Mine; ")
    assert said.endswith("if you trust that code, give --trust")
    assert not (tmp_path / "sprung").exists()
    swarm_mj("study", "run", "s.toml", "--trust")
    # Features are loaded only for a policy that was trained on them.
    assert (tmp_path / "sprung").exists() == (kind != "features")


NINE = [0.01 * n for n in range(1, 10)]
LOSSES = ("erasure", "burst_begin", "burst_end", "range_ratio", "velocity_ratio", "shadowing_db")


def test_lists_that_multiply_to_too_many_missions_are_refused_before_one_is_made(read, monkeypatch):
    """Seven lists of nine values neither ended nor were refused."""
    monkeypatch.setattr("swarm_mj.cli.mission_options.make_mission", None)
    lists = "".join(f"{name} = {NINE}\n" for name in LOSSES)
    rule = (
        r"multiply to 531441 missions \(9 of range_ratio x .*\), and up to 10000 are allowed; give"
    )
    with pytest.raises(ValueError, match=rf"s\.toml: \[mission\]: .* {rule} fewer values"):
        read(f"[mission]\n{lists}")


def test_tables_of_too_many_missions_are_refused(read, monkeypatch):
    monkeypatch.setattr("swarm_mj.cli.study.MAX_REGIMES", 4)
    assert len(read("[missions.a]\nnum_robots = [2, 3, 4, 5]\n").regimes) == 4
    with pytest.raises(ValueError, match="more than 4 missions, the most allowed"):
        read("[missions.a]\nnum_robots = [2, 3, 4]\n[missions.b]\nnum_robots = [5, 6]\n")


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("run nowhere.toml", "study nowhere.toml cannot be found"),
        ("run impairment", "not impairment; did you mean impairments?"),
        ("run r.json", "impairments-small"),
        ("fly s.toml", "action must be one of run, compare, not 'fly'"),
        ("run a.toml b.toml", "study run takes FILE.toml, not a.toml b.toml"),
        ("compare a.parquet", "study compare takes BEFORE.parquet AFTER.parquet, not a.parquet"),
        ("compare a.parquet b.parquet --csv c.csv", "leave out the options"),
        ("compare a.parquet b.parquet", "missions a.parquet cannot be found"),
    ],
)
def test_other_slips_are_refused(refusal, line, complaint):
    assert complaint in refusal("study", *line.split())


@pytest.mark.parametrize(
    "path", sorted(asset("studies").glob("*.toml")), ids=lambda path: path.stem
)
def test_shipped_studies_can_be_flown(path):
    """Making one makes every policy in every regime."""
    study = read_study(path.stem)
    assert {each.task for each in study.regimes} == {"stationary", "random-walk", "flocking"}
    assert len(study.regimes) % 3 == 0


def test_the_small_study_has_the_impairments_of_the_full_one():
    def varied(name):
        regimes = [vars(each) for each in read_study(name).regimes]
        return {field for field in regimes[0] if len({each[field] for each in regimes}) > 1}

    assert varied("impairments-small") == varied("impairments")
    assert "clock_offset_s" in varied("impairments-small")


def test_missions_are_written_and_compared(succeed, tmp_path):
    for name, erasure in (("a", 0.0), ("b", 0.5)):
        (tmp_path / "s.toml").write_text(f"{SMALL}{MISSION}erasure = {erasure}\n")
        succeed("study", "run", "s.toml", "--parquet", f"{name}.parquet")
    rows = pd.read_parquet(tmp_path / "a.parquet")
    assert list(rows["policy"]) == ["mst", "mst", "round-robin", "round-robin"]
    said = succeed("study", "compare", "a.parquet", "a.parquet").stdout
    (age, _) = said.strip().split("\n\n")
    head, columns, *lines = age.splitlines()
    assert head.startswith("aoi, ")
    assert columns.split()[:4] == ["policy", "before", "after", "difference"]
    assert [line.split()[0] for line in lines] == ["mst", "round-robin"]
    said = succeed("study", "compare", "a.parquet", "b.parquet").stdout
    assert "erasure" in said.splitlines()[1]


def test_tasks_without_a_cost_are_compared_by_their_age_only(succeed, tmp_path):
    (tmp_path / "s.toml").write_text(f"{SMALL}{MISSION}task = 'stationary'\n")
    succeed("study", "run", "s.toml", "--parquet", "a.parquet")
    said = succeed("study", "compare", "a.parquet", "a.parquet").stdout
    firsts = [line.split()[0] for line in said.strip().splitlines()]
    assert firsts == ["aoi,", "policy", "mst", "round-robin"]


def test_results_of_two_machines_are_put_together_as_the_guide_says(
    succeed, refusal, tmp_path, monkeypatch
):
    for name, seed in (("first", 1000), ("second", 1002)):
        text = SMALL.replace("episodes = 2", f"episodes = 2\nseed = {seed}")
        (tmp_path / "s.toml").write_text(text + MISSION)
        succeed("study", "run", "s.toml", "--parquet", f"{name}.parquet")
    (tmp_path / "s.toml").write_text(SMALL.replace("episodes = 2", "episodes = 4") + MISSION)
    succeed("study", "run", "s.toml", "--parquet", "whole.parquet")
    guide = (ROOT / "docs" / "studies.md").read_text()
    code = guide.partition("## Results of two machines")[2].split("```")[1].removeprefix("text\n")
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    order = ["policy", "seed"]
    both = pd.read_parquet("both.parquet").sort_values(order, ignore_index=True)
    whole = pd.read_parquet("whole.parquet").sort_values(order, ignore_index=True)
    pd.testing.assert_frame_equal(both, whole)
    succeed("study", "compare", "both.parquet", "whole.parquet")
    exec(code.replace("second", "first"), {})
    assert "is there more than once" in refusal("study", "compare", "both.parquet", "both.parquet")
