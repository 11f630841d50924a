"""`swarm-mj evaluate` as a process: what it prints, writes, refuses, and how it goes on."""

import json
import signal
import sys

import numpy as np
import pytest
from forks import files

from swarm_mj.cli import main, parse
from swarm_mj.evaluation.results import COLUMNS, CONVERGENCE
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.mission import paper
from swarm_mj.policies import registry
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

SMALL = ("--robots", "5", "--windows", "12", "--range-ratio", "0.5")
MISSION = {"num_robots": 5, "num_windows": 12, "range_ratio": 0.5}
# Four batches: 30 missions are flown as 25 and 5, under each policy.
TWO_POLICIES = (*SMALL, "--policy", "mst", "round-robin", "--episodes", "30")
BOTH = ("--json", "r.json", "--csv", "r.csv")


@pytest.fixture(scope="module")
def whole(forks, tmp_path_factory):
    """The files of an evaluation that nothing interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    done = forks.run(folder, "swarm_mj", "evaluate", *TWO_POLICIES, *BOTH)
    assert done.returncode == 0, done.stderr
    assert files(folder) == ["r.csv", "r.json"]
    assert done.stdout.endswith("\nWrote r.json\nWrote r.csv\n")
    return folder


def same_files(folder, whole):
    assert files(folder) == files(whole)
    for name in files(whole):
        assert (folder / name).read_bytes() == (whole / name).read_bytes()


def study(*arguments):
    return parse(["evaluate", *map(str, arguments)])[1].study


def test_the_default_is_the_shipped_policy_and_the_papers_baselines_on_the_papers_flocks():
    default = study()
    assert default.policies == ("planner", "random-flooding", "round-robin", "mst")
    assert default.regimes == (paper("flocking"),)
    assert (default.episodes, default.seed, default.compared_to) == (100, 1000, "planner")


def test_all_is_every_policy_after_those_named():
    assert study("--policy", "all").policies == tuple(POLICIES)
    others = tuple(name for name in POLICIES if name != "mst")
    assert study("--policy", "all", "--policy", "mst").policies == ("mst", *others)


@pytest.mark.parametrize(("task", "is_told"), [("random-walk", True), ("stationary", False)])
@pytest.mark.parametrize("command", ["fly --no-record", "evaluate --episodes 2"])
def test_a_planner_without_payload_that_moves_is_said_to_be_spatial_tdma(
    succeed, command, task, is_told
):
    asked = ("--policy", "planner", "--payload", "none", "--task", task)
    said = succeed(*command.split(), *SMALL, *asked).stderr
    assert ("planner --payload none flies as spatial-tdma where robots move" in said) == is_told


@pytest.mark.parametrize(("robots", "is_said"), [(6, True), (7, False)])
@pytest.mark.parametrize("command", ["fly --no-record", "evaluate --episodes 2"])
def test_a_planner_of_few_robots_is_said_to_fly_as_tdma(capsys, here, command, robots, is_said):
    small = ("--windows", "5", "--range-ratio", "2", "--robots", str(robots))
    assert main([*command.split(), *small, "--policy", "planner"]) == 0
    assert files(here) == []
    said = " ".join(capsys.readouterr().err.split())
    assert (registry.TAKES_TURNS in said) == is_said


def test_the_planner_flies_without_payload_under_a_name_of_its_own():
    alone = "planner --payload none"
    named = study("--policy", "tdma", "planner", "--payload", "none", "--baseline", "planner")
    assert named.policies == ("tdma", alone)
    assert named.compared_to == alone
    assert study("--policy", "planner", alone).policies == ("planner", alone)
    assert study("--payload", "none").policies[0] == alone


def test_results_are_what_the_library_computes(whole):
    results = read_results(whole / "r.csv")
    objects = json.loads((whole / "r.json").read_text())["results"]
    mission = paper("flocking", **MISSION)
    for result, row, policy in zip(results, objects, ("mst", "round-robin"), strict=True):
        flight = rollout(Swarm(mission, range(1000, 1030)), make_policy(policy, mission))
        summary = summarise(list(flight))
        np.testing.assert_allclose(row["episode_aoi"], summary.aoi_mean)
        np.testing.assert_allclose(row["episode_velocity_variance"], summary.velocity_variance_mean)
        assert result.aoi_mean == pytest.approx(summary.aoi_mean.mean())
        np.testing.assert_allclose(row["episode_task_cost"], summary.task_cost_mean)
        assert result.task_cost_last_mean == pytest.approx(summary.task_cost_last.mean())
        episodes = ["episode_aoi", "episode_velocity_variance", "episode_task_cost"]
        of_flocks = [f"episode_{name}" for name in CONVERGENCE]
        assert list(row) == [*COLUMNS, *episodes, *of_flocks]
        assert row["episode_strayed"] == [0.0] * 30
        assert {name: row[name] for name in COLUMNS} == {n: getattr(result, n) for n in COLUMNS}


# Evaluates as `swarm-mj` does, and ends itself by a signal when so many batches are kept.
EVALUATE_AND_END = """
import os, signal, sys
from swarm_mj.cli import main, parse
from swarm_mj.evaluation import flying
which, count = int(sys.argv[1]), int(sys.argv[2])
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored
append, kept = flying.append_progress, []
def ending(*arguments):
    append(*arguments)
    kept.append(arguments)
    if len(kept) == count:
        os.kill(os.getpid(), which)
flying.append_progress = ending
if __name__ == "__main__":  # jobs import it
    sys.exit(main(sys.argv[3:]))
"""


@pytest.fixture
def evaluate_and_end(forks, tmp_path_factory):
    script = tmp_path_factory.mktemp("script") / "evaluate_and_end.py"
    script.write_text(EVALUATE_AND_END)

    def run(folder, which, count, *arguments):
        return forks.run(folder, script, int(which), count, "evaluate", *arguments)

    return run


@pytest.mark.slow
@pytest.mark.parametrize(("jobs", "count"), [(1, 1), (2, 3)])
def test_ctrl_c_keeps_what_was_flown_and_resuming_ends_in_the_same_files(
    succeed, evaluate_and_end, tmp_path, whole, jobs, count
):
    done = evaluate_and_end(tmp_path, signal.SIGINT, count, *TWO_POLICIES, *BOTH, "--jobs", jobs)
    assert done.returncode == 130, done.stderr
    assert "of 60 missions; the same command with --resume continues" in done.stderr
    assert "Traceback" not in done.stderr
    assert files(tmp_path) == ["r.json.progress"]
    lines = (tmp_path / "r.json.progress").read_text().splitlines()
    assert len(lines) == 1 + count
    succeed("evaluate", *TWO_POLICIES, *BOTH, "--resume", "--jobs", 3 - jobs)
    same_files(tmp_path, whole)


def test_ctrl_c_before_a_mission_is_flown_leaves_nothing_in_the_way(here, monkeypatch, capsys):
    """An empty progress file made the same command ask for --resume or --force."""

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    command = ["evaluate", *BRIEF, "--robots", "3", "--json", "a.json"]
    with monkeypatch.context() as patch:
        patch.setattr("swarm_mj.evaluation.flying.fly_study", interrupted)
        assert main(command) == 130
    said = " ".join(capsys.readouterr().err.split())
    assert "after 0 of 2 missions; none was flown to its end yet, so nothing is kept." in said
    assert files(here) == []
    assert main(command) == 0


def test_a_killed_evaluation_resumes_with_only_what_is_left(evaluate_and_end, tmp_path, whole):
    """Three of four batches are kept, so the second kept batch never comes."""
    done = evaluate_and_end(tmp_path, signal.SIGKILL, 3, *TWO_POLICIES, *BOTH)
    assert done.returncode == -signal.SIGKILL
    done = evaluate_and_end(tmp_path, signal.SIGKILL, 2, *TWO_POLICIES, *BOTH, "--resume")
    assert done.returncode == 0, done.stderr
    same_files(tmp_path, whole)


def test_progress_needs_a_word_on_what_to_do_with_it(
    evaluate_and_end, succeed, refusal, tmp_path, whole
):
    evaluate_and_end(tmp_path, signal.SIGKILL, 1, *TWO_POLICIES, *BOTH)
    kept = (tmp_path / "r.json.progress").read_bytes()
    line = refusal("evaluate", *TWO_POLICIES, *BOTH)
    assert "continue it with --resume, or start over with --force" in line
    line = refusal("evaluate", *TWO_POLICIES, *BOTH, "--resume", "--seed", 1)
    assert "its seed is 1000, not 1; repeat that one" in line
    assert (tmp_path / "r.json.progress").read_bytes() == kept
    succeed("evaluate", *TWO_POLICIES, *BOTH, "--force")
    same_files(tmp_path, whole)


def test_resuming_what_never_began_begins_it(succeed, tmp_path, whole):
    succeed("evaluate", *TWO_POLICIES, *BOTH, "--resume")
    same_files(tmp_path, whole)


FAIL = ("--failure-fraction", "0", "0.4", "--policy", "mst", "--episodes", "3")


@pytest.mark.slow
def test_robots_that_fail_are_another_regime_in_results_and_progress(
    evaluate_and_end, succeed, refusal, tmp_path
):
    evaluate_and_end(tmp_path, signal.SIGKILL, 1, *SMALL, *FAIL, *BOTH)
    alike = ("--failure-fraction", "0", "0.2", *FAIL[3:])
    line = refusal("evaluate", *SMALL, *alike, *BOTH, "--resume")
    assert "its failure_fraction is 0.4, not 0.2; repeat that one" in line
    done = succeed("evaluate", *SMALL, *FAIL, *BOTH, "--resume")
    said = " ".join(done.stdout.split())
    assert "12 windows of exact physics, 40% of the robots off half-way" in said
    results = read_results(tmp_path / "r.csv")
    assert [result.failure_fraction for result in results] == [0.0, 0.4]
    assert [json.loads(result.config)["failure_fraction"] for result in results] == [0.0, 0.4]
    assert results[0].aoi_mean != results[1].aoi_mean


def test_a_chart_is_drawn_by_its_ending_beside_the_table(succeed, refusal, tmp_path):
    two = (*SMALL, "--policy", "mst", "round-robin", "--episodes", "2", "--task", "random-walk")
    done = succeed("evaluate", *two, "--fading", "rayleigh", "--plot", "a.svg")
    assert done.stdout.endswith("Wrote a.svg\n")
    assert "round-robin" in done.stdout
    drawn = (tmp_path / "a.svg").read_text()
    for said in ("random-walk, preset paper: 5 robots", "fading rayleigh", "round-robin"):
        assert f"<!-- {said}" in drawn or said in drawn
    assert "a.svg exists" in refusal("evaluate", *two, "--plot", "a.svg")
    succeed("evaluate", *two, "--plot", "a.PNG")
    assert (tmp_path / "a.PNG").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("output", ["json", "csv"])
def test_existing_results_need_force(succeed, refusal, tmp_path, output):
    """One mission of one window has results, too."""
    path = tmp_path / "out" / f"r.{output}"
    short = ("--robots", 5, "--windows", 1, "--range-ratio", 0.5, "--episodes", 1)
    arguments = ("evaluate", *short, f"--{output}", path)
    path.parent.mkdir()
    path.write_text("precious")
    assert "--force" in refusal(*arguments)
    assert path.read_text() == "precious"
    done = succeed(*arguments, "--force")
    assert "AoI ± SEM" in done.stdout
    assert files(tmp_path) == [f"out/r.{output}"]
    if output == "csv":
        assert [result.aoi_sem for result in read_results(path)] == [None] * 4


REFUSED = {
    "--robots 10 1": "a whole number from 2 to 10000 [robots], not 1",
    "--range-ratio 0.02 --jobs 2": "too sparse",
    "--resume": "--resume needs the --json or --csv",
    "--plot chart.jpg": "--plot must be named *.png or *.svg or *.pdf, not chart.jpg",
    "--csv r.json --json ./r.json": "same file",
    "--json o.json --csv o.json.progress": "--csv must be named *.csv, not o.json",
}


@pytest.mark.parametrize("options", REFUSED)
def test_bad_input_is_one_clear_line(refusal, options):
    assert REFUSED[options] in refusal("evaluate", *options.split())


def test_a_link_to_the_progress_file_is_no_output(refusal, tmp_path):
    (tmp_path / "l.csv").symlink_to(tmp_path / "p.json.progress")
    line = refusal("evaluate", *SMALL, "--json", "p.json", "--csv", "l.csv", "--force")
    assert "progress and --csv name the same file" in line


FRAIL = """
class Frail:
    def __call__(self, buffers, states):
        if buffers.position_m.shape[1] == 4:
            raise RuntimeError("four is too many")
        return 0.0 * states.velocity_mps
"""
BRIEF = ("--policy", "tdma", "--windows", "2", "--episodes", "2", "--range-ratio", "2")


def test_a_part_that_fails_says_how_to_go_on_and_what_changed_code_needs(here, capsys):
    (here / "frail.py").write_text(FRAIL)
    command = ["evaluate", *BRIEF, "--robots", "3", "4", "--controller", "frail:Frail"]
    command += ["--csv", "a.csv"]
    assert main(command) == 2
    hint, error = capsys.readouterr().err.splitlines()
    assert hint.startswith("Failed after 2 of 4 missions; the same command with --resume continues")
    assert "own code must change first, start over with --force" in hint
    assert "four is too many" in error
    assert main([*command, "--resume"]) == 2
    assert "four is too many" in capsys.readouterr().err
    # Python tells its cached bytecode by the file's second and size: so another size.
    (here / "frail.py").write_text(FRAIL.replace("== 4", "== 50"))
    del sys.modules["frail"]
    assert main([*command, "--resume"]) == 2
    assert "is of another evaluation: its frail:Frail is" in capsys.readouterr().err
    assert main([*command, "--force"]) == 0


def test_a_failure_before_anything_was_flown_says_no_more_than_the_error(here, capsys):
    (here / "frail_at_once.py").write_text(FRAIL)
    command = ["evaluate", *BRIEF, "--robots", "4", "--controller", "frail_at_once:Frail"]
    assert main([*command, "--csv", "a.csv"]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert "four is too many" in error
    assert files(here) == ["frail_at_once.py"]


@pytest.mark.parametrize("module", ["pandas", "pyarrow"])
def test_what_parquet_needs_is_asked_for_before_anything_is_flown(
    here, monkeypatch, capsys, module
):
    """A small installation flew everything, and then could not write it."""
    monkeypatch.setattr("swarm_mj.system.packages.is_installed", lambda name: name != module)
    monkeypatch.setattr("swarm_mj.evaluation.flying.fly_study", None)
    assert main(["evaluate", *BRIEF, "--robots", "3", "--parquet", "a.parquet"]) == 1
    assert f"--parquet needs {module}, which is not installed; pip" in capsys.readouterr().err
    assert files(here) == []


def test_files_that_name_no_commit_are_said_to_once(here, monkeypatch, capsys):
    monkeypatch.setattr("swarm_mj.evaluation.study.commit", lambda: None)
    command = ["evaluate", *BRIEF, "--robots", "3"]
    assert main(command) == 0
    assert capsys.readouterr().err == ""
    assert main([*command, "--csv", "a.csv", "--json", "a.json"]) == 0
    assert capsys.readouterr().err.startswith("The files name no commit: this swarm_mj was built")
    assert files(here) == ["a.csv", "a.json"]
