"""A run that stops, for whatever reason, goes on and ends as one that never stopped.

The runs are in a process of their own, where they may be killed, and no type checks slow them:

    python test_resume.py FOLDER

writes what came out to FOLDER/results.json. Before the last child is forked torch computes in
children only: its threads would not survive the fork.
"""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_runs import StopAfter, difference, end_of, run, small_training

from swarm_mj.cli import main
from swarm_mj.learning import selection
from swarm_mj.learning.graph_vec_env import GraphVecEnv
from swarm_mj.learning.held_out import fly_references
from swarm_mj.learning.selection import Progress
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import paper
from swarm_mj.policies.gnn.own_networks import load_network
from swarm_mj.policies.learned import sample

pytestmark = pytest.mark.slow  # `cli/test_own_parts.py` holds the law once

RESUMED = {
    "robot, discounted": {"discount": 0.9},
    "robot, walking, two sizes": {"task": "random-walk", "sizes": (4, 6)},
    "robot, lengths drawn": {"train_windows": (6, 15), "unknown_age": 20.0, "most_speech": 0.3},
    "robot, several kinds": {
        **{"sizes": (4, 6), "missions": 8, "groups": 4, "credit_scaling": "kind"},
        "other_missions": (paper("flocking", num_windows=20, range_ratio=1.0, erasure=0.2),),
    },
    "team, two sizes": {"credit": "team", "sizes": (4, 6)},
    "robot, two sizes, with a memory": {"sizes": (4, 6), "own_network": "tiny_networks:Counting"},
    "team, for the flock": {"credit": "team", "task": "flocking", "reward": "velocity-variance"},
}


def resumed(folder):
    """How runs that were interrupted twice differ from those that were not, by name."""
    sys.path.append(str(Path(__file__).parents[1]))
    load_network("tiny_networks:Counting")
    return {name: _interrupted_twice(folder / name, asked) for name, asked in RESUMED.items()}


def _interrupted_twice(folder, asked):
    # Once in the first missions, once after missions have been cut, ended and begun anew.
    training = small_training(**asked)
    decisions = 6 * 8 * training.missions
    run(training, folder / "whole", decisions)
    stopped = [
        run(training, folder / "cut", decisions, StopAfter(windows), is_resumed=is_resumed)
        for is_resumed, windows in ((False, 5), (True, 25))
    ]
    run(training, folder / "cut", decisions, is_resumed=True)
    went = [progress.decisions for progress in stopped]
    return {
        "difference": difference(end_of(folder / "whole"), end_of(folder / "cut")),
        "stopped in time": 0 < went[0] < went[1] < decisions,
    }


def timed(folder):
    """How the end of a run that was stopped by the clock differs from that of one that was not.

    But for what one evaluation more at every stop brings: rows of the curve, candidates, and so
    the policy kept. No minutes are kept back for the choice: every session trains.
    """
    selection.reserved_minutes = lambda *_: 0.0
    training = small_training()
    run(training, folder / "untimed", 192)
    progress, num_sessions = Progress(), 0
    while progress.decisions < 192:
        minutes = progress.minutes + 0.1 / 60.0
        progress = run(training, folder / "timed", is_resumed=num_sessions > 0, minutes=minutes)
        num_sessions += 1
    ends = [end_of(folder / name) for name in ("untimed", "timed")]
    for end in ends:
        del end["progress"], end["policy file"], end["curve rows"], end["candidates"]
    return {"difference": difference(*ends), "sessions": num_sessions}


ASKED = (
    *("--robots", "4", "--windows", "12", "--range-ratio", "1", "--missions", "4"),
    *("--held-out", "2", "--evaluate-every", "128", "--budget", "128", "--seed", "2"),
    *("--learning-rate", "0.01"),  # so that each evaluation has a better policy to keep
)


def killed(folder):
    """How killed and resumed runs differ from one that was not, by the moment.

    A run is killed after each file or folder that it puts in its place, so every state that its
    folder can be in is met.
    """
    import torch._dynamo  # noqa: F401 - optimisers import it late, so every child would

    os.chdir(folder)
    _load_compiled_functions()
    policy = _in_a_child(lambda: main(["train", "--out", "first", "--latent", "4", *ASKED]))
    asked = ("train", "--init", "first", *ASKED)
    moments = folder / "moments"
    whole = _in_a_child(lambda: _train_and_die([*asked, "--out", "whole"], None, moments))
    found = {"exit codes": [policy, whole], "moments": {}}
    for moment, placed in enumerate(moments.read_text().split()):
        out = f"killed-{moment}"
        died = _in_a_child(lambda: _train_and_die([*asked, "--out", out], moment, moments))  # noqa: B023
        went_on = _in_a_child(lambda: main(["train", "--out", out, "--resume"]))  # noqa: B023
        left = sorted(path.name for path in Path(out).iterdir() if path.name.startswith("."))
        found["moments"][f"{moment} {placed}"] = {
            "exit codes": [died, went_on],
            "difference": difference(end_of(Path("whole")), end_of(Path(out))),
            "left over": left,
        }
    return found


def _train_and_die(arguments, moment, moments):
    """Trains as `swarm-mj train`, and dies after the file of this number is placed."""
    placed, place = [], os.replace

    def then_die(part, target):
        place(part, target)
        if Path(target).resolve().is_relative_to(Path.cwd()):  # others are compilers' caches
            placed.append(Path(target).name)
            if len(placed) - 1 == moment:
                os.kill(os.getpid(), signal.SIGKILL)

    os.replace = then_die
    code = main(arguments)
    moments.write_text("\n".join(placed))
    return code


def _load_compiled_functions():
    """Once, for all children: the simulation, features, credits, draws, the policies compared."""
    mission = paper("stationary", num_robots=4, range_ratio=1.0)
    training = replace(usual_settings("robot", mission, (4,)), missions=1, groups=1)
    env = GraphVecEnv(training, np.random.default_rng(1))
    env.reset()
    for recipients in ([1, 1, 2, 3], [0, 1, 0, 3]):
        env.step(np.array(recipients))
    for kind in (np.float32, np.float64):  # of stored policies and of those in training
        sample(np.zeros((2, 3), dtype=kind), np.array([0.1, 0.9]))
    fly_references(small_training(), lambda _share: None)


def _in_a_child(work):
    """Does the work in a forked process; returns its exit code, negative for a signal."""
    child = os.fork()
    if child == 0:
        sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115 - it exits at once
        os._exit(work())
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def learned(folder):
    """Held-out ages of 5 robots that begin all but silent, before and after a short training."""
    usual = small_training()
    training = replace(
        usual,
        features="paper",
        network=replace(usual.network, num_features=8),
        silence_logit=5.0,
        ppo=replace(usual.ppo, learning_rate=2e-3, entropy=0.003),
        seed=1,
        held_out=10,
        evaluate_every=1_000,
    )
    return [row.costs.aoi for row in run(training, folder / "learned", 2_000).curve]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """What came of the runs in a process of their own."""
    folder = tmp_path_factory.mktemp("runs")
    done = subprocess.run(
        [sys.executable, __file__, folder],
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "results.json").read_text())


@pytest.mark.parametrize("name", RESUMED)
def test_interrupted_twice_it_ends_as_if_it_had_not_been(results, name):
    """Weights, optimiser, normaliser, random states, missions, curve and the policy kept."""
    assert results["resumed"][name] == {"difference": "", "stopped in time": True}


def test_stopped_by_the_clock_it_ends_as_if_it_had_not_been(results):
    assert results["timed"]["difference"] == ""
    assert results["timed"]["sessions"] > 1


def test_killed_at_any_moment_it_resumes_and_ends_as_if_it_had_not_been(results):
    """Also while a policy takes another's place, and before there is a checkpoint."""
    killed = results["killed"]
    assert killed["exit codes"] == [0, 0]
    placed = " ".join(killed["moments"])
    for name in ("0 settings.json", "1 init", "curve.csv", "checkpoint.pt", "policy.safetensors"):
        assert name in placed
    for moment, found in killed["moments"].items():
        assert found == {"exit codes": [-9, 0], "difference": "", "left over": []}, moment


def test_a_short_training_beats_its_own_start(results):
    """On missions that it never trained on; with seeds 1 to 7 it fell to 0.32 to 0.39."""
    ages = results["learned"]
    assert ages[-1] < 0.6 * ages[0]


if __name__ == "__main__":
    where = Path(sys.argv[1])
    results = {work.__name__: work(where) for work in (killed, resumed, timed, learned)}
    (where / "results.json").write_text(json.dumps(results, indent=1))
