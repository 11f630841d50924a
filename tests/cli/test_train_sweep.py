"""`swarm-mj train --sweep`: what a file asks for, what is refused, and that its runs go on."""

import sys

import pytest

from swarm_mj.cli import main
from swarm_mj.cli.train import asked_run
from swarm_mj.cli.train_sweep import read_sweep, run_sweep, train_apart
from swarm_mj.learning.run_folder import read_curve, read_run

SWEEP = """
[train]
task = "stationary"
robots = [4, 5]
windows = 8
budget = 64
rollout-windows = 4
minibatches = 4
held-out = 2
latent = 4
linear = false
[sweep]
seed = [1, 2]
learning-rate = [0.001, 0.01]
"""


@pytest.fixture
def sweep(here):
    (here / "sweep.toml").write_text(SWEEP)
    return here


def train(*arguments):
    return main(["train", *map(str, arguments)])


def test_all_values_are_combined_and_name_their_runs(sweep):
    trainings = read_sweep(sweep / "sweep.toml")
    assert list(trainings) == [
        "seed-1_learning-rate-0.001",
        "seed-1_learning-rate-0.01",
        "seed-2_learning-rate-0.001",
        "seed-2_learning-rate-0.01",
    ]
    shared = "--task stationary --robots 4 5 --windows 8 --budget 64"
    shared += " --rollout-windows 4 --minibatches 4 --held-out 2 --latent 4"
    assert trainings["seed-2_learning-rate-0.01"] == [
        *shared.split(),
        *["--seed", "2", "--learning-rate", "0.01"],
    ]


def test_flags_and_several_sizes_are_values_too(here):
    (here / "a.toml").write_text("[sweep]\nlinear = [false, true]\nrobots = [10, [20, 40]]\n")
    assert read_sweep(here / "a.toml") == {
        "linear-False_robots-10": ["--robots", "10"],
        "linear-False_robots-20-40": ["--robots", "20", "40"],
        "linear-True_robots-10": ["--linear", "--robots", "10"],
        "linear-True_robots-20-40": ["--linear", "--robots", "20", "40"],
    }
    (here / "b.toml").write_text("[train]\nseed = 3\n")
    assert read_sweep(here / "b.toml") == {"training": ["--seed", "3"]}


@pytest.mark.slow
def test_runs_are_trained_and_go_on(sweep, capsys):
    (sweep / "sweep.toml").write_text(SWEEP.replace("[0.001, 0.01]", "[0.01]"))
    asked = ("--sweep", "sweep.toml", "--out", "runs")
    assert train(*asked) == 0
    out, err = capsys.readouterr()
    names = ["seed-1_learning-rate-0.01", "seed-2_learning-rate-0.01"]
    assert [line.partition(":")[0] for line in err.splitlines() if "at best" in line] == names
    assert "Compare: " in out
    for seed, name in enumerate(names, start=1):
        assert read_run(sweep / "runs" / name).training.seed == seed
        assert read_curve(sweep / "runs" / name / "curve.csv")[-1].decisions == 64
    assert train(*asked) == 2
    assert "go on with a run by --resume" in capsys.readouterr().err
    (sweep / "sweep.toml").write_text(
        SWEEP.replace("[0.001, 0.01]", "[0.01]").replace("budget = 64", "budget = 128")
    )
    assert train(*asked, "--resume") == 0
    for name in names:
        assert read_curve(sweep / "runs" / name / "curve.csv")[-1].decisions == 128


@pytest.mark.slow
def test_processes_train_the_same(sweep):
    for out, jobs in (("one", 1), ("two", 2)):
        assert train("--sweep", "sweep.toml", "--out", out, "--jobs", jobs) == 0
    for name in read_sweep(sweep / "sweep.toml"):
        one, two = (read_curve(sweep / out / name / "curve.csv") for out in ("one", "two"))
        assert [row.aoi for row in one] == [row.aoi for row in two]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[sweep]\nseed = 1\n", "[sweep] seed must be"),
        ("[sweeps]\nseed = [1]\n", "sweeps"),
        ("[sweep]\nseed = []\n", "it must have 1 to 1000 trainings, not 0"),
        (f"[sweep]\nseed = {list(range(1001))}\n", "it must have 1 to 1000 trainings, not 1001"),
        ("[sweep]\nseed = [1, 2, 1]\n", "two trainings would have the folder seed-1;"),
        ("[sweep]\nfeatures = ['a:b', 'a/b']\n", "would have the folder features-a-b;"),
        ("[train]\nout = 'x'\n", "--out belongs on the command line, not into the file"),
        ("[train]\nrobots = 5\nlive = 'web'\n", "sweep.toml: --live shows one training"),
        ("[train]\nseed = 1979-05-27\nrobots = 5\n", "1979-05-27"),
        ("[train", "sweep.toml"),
        ("[train]\nsedd = 1\n", "--sedd"),
        ("[train]\nrobots = 5\nepochs = 0\n", "epochs"),
    ],
)
def test_a_wrong_file_is_refused_before_anything_is_trained(here, capsys, text, said):
    (here / "sweep.toml").write_text(text)
    assert train("--sweep", "sweep.toml", "--out", "runs") == 2
    assert said in capsys.readouterr().err
    assert not (here / "runs").exists()


def test_options_stand_in_the_file_or_on_the_command_line(sweep, capsys):
    assert train("--sweep", "sweep.toml", "--out", "runs", "--budget", 5) == 2
    assert "options of trainings stand in sweep.toml" in capsys.readouterr().err
    assert train("--out", "runs", "--jobs", 2) == 2
    assert "add --sweep FILE" in capsys.readouterr().err
    assert not (sweep / "runs").exists()


def test_a_training_that_fails_elsewhere_says_why(here):
    outcome = train_apart(["train", "--robots", "5", "--init", "none", "--out", str(here / "x")])
    assert outcome.code == 2
    assert outcome.said.startswith("there is no policy none")


DEADLY = """
import os, signal
class Logger:
    def start(self, settings, folder):
        if folder.name == "seed-1":
            os.kill(os.getpid(), signal.SIGKILL)
        if folder.name == "seed-2":
            os._exit(9)
    def log(self, row, decisions):
        pass
    def finish(self):
        pass
"""


@pytest.mark.slow
def test_a_training_that_is_killed_is_named_and_takes_no_other_with_it(sweep, capsys):
    """One of three was, and the sweep ended with it, as did every attempt to go on."""
    (sweep / "deadly.py").write_text(DEADLY)
    text = SWEEP.partition("[sweep]")[0] + "logger = 'deadly:Logger'\n[sweep]\n"
    (sweep / "sweep.toml").write_text(f"{text}seed = [1, 2, 3]\n")
    for more in ((), ("--resume",)):
        assert train("--sweep", "sweep.toml", "--out", "runs", "--jobs", 2, *more) == 1
        said = capsys.readouterr().err
        assert "seed-1: was ended by signal 9, perhaps for want of memory\n" in said
        assert "seed-2: ended with exit code 9\n" in said
        assert "seed-3: 64 decisions, age" in said
        assert said.endswith("2 of 3 trainings failed (seed-1, seed-2); --resume tries again\n")


def test_an_engine_that_breaks_down_tells_of_resume(sweep):
    class Broken:
        def run(self, work, pieces):  # noqa: ARG002
            raise OSError("Ray gave up")
            yield

    with pytest.raises(OSError, match=r"^Ray gave up; --resume goes on with the trainings$"):
        run_sweep(sweep / "sweep.toml", sweep / "runs", Broken(), asked_run, is_resumed=False)


def test_ctrl_c_tells_of_resume(sweep, capsys):
    class Interrupted:
        def run(self, work, pieces):  # noqa: ARG002
            raise KeyboardInterrupt
            yield

    path = sweep / "sweep.toml"
    assert run_sweep(path, sweep / "runs", Interrupted(), asked_run, is_resumed=False) == 130
    assert capsys.readouterr().err.startswith("Interrupted; --resume goes on from each training's")


def test_a_logger_is_loaded_before_trainings_so_that_it_travels_with_them(sweep, capsys):
    """Ray's workers have the user's modules that are loaded here: they lacked the logger's."""
    (sweep / "keeping_lines.py").write_text(DEADLY.replace("Logger", "Lines"))

    class Ends:
        def run(self, work, pieces):  # noqa: ARG002
            assert "keeping_lines" in sys.modules
            raise OSError("enough is seen")
            yield

    text = SWEEP.replace("[sweep]", "logger = 'keeping_lines:Lines'\n[sweep]")
    (sweep / "sweep.toml").write_text(text)
    with pytest.raises(OSError, match="enough is seen"):
        run_sweep(sweep / "sweep.toml", sweep / "runs", Ends(), asked_run, is_resumed=False)
    (sweep / "sweep.toml").write_text(text.replace(":Lines", ":Line"))
    assert train("--sweep", "sweep.toml", "--out", "runs") == 2
    assert "keeping_lines.py has no Line; did you mean Lines?" in capsys.readouterr().err
    assert not (sweep / "runs").exists()
