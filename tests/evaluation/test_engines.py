"""Engines do all pieces once, and end with whoever started them.

Those of a Ray cluster and of SLURM are tried by `make test-engines`, which has what they need.
"""

import math
import multiprocessing
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import time
import types
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp

import psutil
import pytest
from rich.console import Console
from tiny_policies import save_tiny

from swarm_mj.cli import main
from swarm_mj.evaluation import engines
from swarm_mj.evaluation.engines import SURROUNDINGS, EngineOptions, Local, Ray, Slurm
from swarm_mj.evaluation.flying import fly_study
from swarm_mj.evaluation.study import Study
from swarm_mj.evaluation.summary import study_results, write_evaluated
from swarm_mj.mission import paper
from swarm_mj.system.interrupt import INTERRUPTS

ROOT = Path(__file__).parents[2]


def square(piece):
    return piece**2, os.getpid()


def patient(piece):
    """Waits for the file that another piece makes."""
    waits_for, makes = piece
    makes.touch()
    while not waits_for.exists():
        time.sleep(0.01)
    return os.getpid()


def fail_at_3(piece):
    if piece == 3:
        raise ValueError("three is too many")
    return piece


def die_if(piece):
    if piece:
        os.kill(os.getpid(), signal.SIGKILL)


def surroundings(_piece):
    for number in INTERRUPTS:
        signal.raise_signal(number)
    return {name: os.environ.get(name) for name in SURROUNDINGS}


def sleep(piece):
    time.sleep(piece)


@pytest.mark.slow
@pytest.mark.parametrize(("num_jobs", "num_pieces"), [(1, 7), (9, 2), (2, 0)])
def test_every_piece_is_done_once_by_this_process_if_it_is_the_only_one(num_jobs, num_pieces):
    done = dict(Local(num_jobs=num_jobs).run(square, range(num_pieces)))
    products = {index: product for index, (product, _) in done.items()}
    assert products == {index: index**2 for index in range(num_pieces)}
    if num_jobs == 1:
        assert {pid for _, pid in done.values()} == {os.getpid()}


@pytest.mark.slow
def test_two_jobs_work_at_the_same_time(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    pids = dict(Local(num_jobs=2).run(patient, [(a, b), (b, a)]))
    assert len({os.getpid(), *pids.values()}) == 3


@pytest.mark.slow
@pytest.mark.parametrize("num_jobs", [1, 2])
def test_a_failure_is_raised_here(num_jobs):
    with pytest.raises(ValueError, match="three is too many"):
        list(Local(num_jobs=num_jobs).run(fail_at_3, range(6)))
    assert multiprocessing.active_children() == []


@pytest.mark.slow
def test_a_job_that_dies_is_noticed():
    with pytest.raises(OSError, match="ended from outside"):
        list(Local(num_jobs=2).run(die_if, [False, True]))


@pytest.mark.slow
def test_jobs_hear_no_ctrl_c_and_start_no_threads(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ)
    found = [product for _, product in Local(num_jobs=2).run(surroundings, range(2))]
    assert found == [SURROUNDINGS] * 2
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == set()
    assert dict(os.environ) == before


@pytest.mark.slow
def test_breaking_off_ends_the_jobs_at_once():
    work = Local(num_jobs=2).run(sleep, [0.0, 600.0, 600.0])
    next(work)
    assert len(multiprocessing.active_children()) == 2
    work.close()
    assert multiprocessing.active_children() == []


@pytest.mark.slow
def test_jobs_run_nothing_of_the_folder_here(trapped):
    assert sorted(product for _, (product, _) in Local(num_jobs=2).run(square, [2, 3])) == [4, 9]
    assert not trapped.exists()


STUDY = Study(
    policies=("tdma", "random-flooding"),
    regimes=(paper("random-walk", num_robots=4, num_windows=20),),
    episodes=60,
)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What one process of this machine writes of STUDY."""
    return written(Local(), tmp_path_factory.mktemp("alone"))


def written(engine, folder):
    """The files of STUDY, as bytes, by their suffixes."""
    costs = {}
    fly_study(STUDY, costs, engine, None, Console(file=None, quiet=True))
    assert set(costs) == set(range(len(STUDY.batches)))
    found = {}
    for suffix in (".csv", ".json"):
        path = folder / f"study{suffix}"
        write_evaluated(path, study_results(STUDY, costs, STUDY.header()))
        found[suffix] = path.read_bytes()
    return found


class Backwards:
    """Does the last piece first."""

    def run(self, work, pieces):
        yield from ((index, work(pieces[index])) for index in reversed(range(len(pieces))))


def test_the_order_in_which_an_engine_is_done_changes_nothing(alone, tmp_path):
    assert written(Backwards(), tmp_path) == alone


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"address": "auto"}, "address auto is of a Ray cluster; add --engine ray"),
        ({"engine": "slurm", "address": "auto"}, "address auto is of a Ray cluster"),
    ],
)
def test_what_no_engine_can_do_is_refused(options, complaint):
    with pytest.raises(ValueError, match=complaint):
        EngineOptions(**options).engine_for(STUDY)


@pytest.mark.parametrize(("engine", "package"), [("ray", "ray"), ("slurm", "submitit")])
def test_an_engine_that_is_not_installed_leaves_nothing(here, monkeypatch, capsys, engine, package):
    monkeypatch.setattr("swarm_mj.system.packages.is_installed", lambda module: module == "scipy")
    assert main(["evaluate", "--policy", "tdma", "--engine", engine, "--csv", "a.csv"]) != 0
    assert f"the engine {engine} needs {package}, which is not in" in capsys.readouterr().err
    assert list(here.iterdir()) == []


@pytest.mark.slow
def test_ray_that_does_not_start_is_an_error_of_one_line(monkeypatch):
    """Ray raises bare exceptions, of several lines: they were a traceback."""

    def fails(**_):
        raise Exception("The node timed out.\n  Look at\n/tmp/ray")

    ray = types.SimpleNamespace(
        init=fails, shutdown=lambda: None, exceptions=types.SimpleNamespace(RayError=RuntimeError)
    )
    monkeypatch.setitem(sys.modules, "ray", ray)
    with pytest.raises(
        OSError, match=r"^Ray did not start: The node timed out\. Look at /tmp/ray$"
    ):
        list(Ray().run(square, [1]))


def test_slurm_without_sbatch_is_refused(monkeypatch, tmp_path):
    pytest.importorskip("submitit", reason="needs submitit: make test-engines")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OSError, match="there is no sbatch here"):
        EngineOptions(engine="slurm").engine_for(STUDY)


@pytest.fixture
def jobs(here):  # noqa: ARG001
    """SLURM's engine with submitit's processes in place of SLURM's jobs."""
    pytest.importorskip("submitit", reason="needs submitit: make test-engines")
    return Slurm(cluster="local")


def sent(work):
    """A function that is pickled by value, as those of a script are: no other process has these."""
    work.__module__ = "__main__"
    return work


@sent
def die(_piece):
    os.kill(os.getpid(), signal.SIGKILL)


def test_jobs_write_what_one_process_writes(jobs, here, alone, monkeypatch):
    """Among them one job that is killed, whose pieces are submitted again."""
    kill_one(monkeypatch, here)
    assert written(jobs, here) == alone
    assert (here / "killed").exists()
    assert not list(here.glob("slurm-*"))


def kill_one(monkeypatch, folder):
    """Has the first job that begins to fly die at once."""
    code = """
import os, signal, sys
if "submitit.core._submit" in " ".join(sys.orig_argv) and not os.path.exists("killed"):
    open("killed", "w").close()
    os.kill(os.getpid(), signal.SIGKILL)
"""
    (folder / "sitecustomize.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(ROOT)]))


def test_jobs_are_called_after_the_command(jobs, monkeypatch):
    """As `squeue` shows them; they were called after the package that submits them."""
    submitit = pytest.importorskip("submitit")
    given = {}

    def take(_executor, **parameters):
        given.update(parameters)
        raise KeyboardInterrupt

    monkeypatch.setattr(submitit.AutoExecutor, "update_parameters", take)
    with pytest.raises(KeyboardInterrupt):
        list(jobs.run(square, [1]))
    assert (given["name"], given["slurm_wckey"]) == ("swarm-mj", "swarm-mj")


def test_pieces_that_always_fail_are_given_up(jobs, monkeypatch):
    monkeypatch.setattr(engines, "ATTEMPTS", 1)
    with pytest.raises(OSError, match=r"1 pieces failed 1 times; the logs are in .*slurm-") as told:
        list(jobs.run(die, [0]))
    assert list(Path(str(told.value).rpartition(" ")[2]).glob("*_log.err"))


@pytest.fixture(scope="module")
def cluster():
    """The address of a Ray cluster of one node, with one CPU."""
    # Ray reads them as it is imported, and keeps a token in one's home unless it has one.
    os.environ |= {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}
    pytest.importorskip("ray", reason="needs ray: make test-engines")
    folder = mkdtemp(prefix="ray-", dir="/tmp")  # a socket's path must be short
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    head = ["--head", f"--port={address.partition(':')[2]}", f"--temp-dir={folder}"]
    with node(*head, "--include-dashboard=false"):
        yield address
    shutil.rmtree(folder)


@contextmanager
def node(*options):
    """Starts a node, and kills it with all its processes in the end."""
    program = [sys.executable, "-m", "ray.scripts.scripts", "start", "--block", "--num-cpus=1"]
    more = ["--node-ip-address=127.0.0.1", "--object-store-memory=100000000", *options]
    environment = os.environ | engines.QUIET | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen([*program, *more], env=environment, stdout=subprocess.PIPE) as process:
        while b"This command will now block" not in process.stdout.readline():
            assert process.poll() is None
        try:
            yield process
        finally:
            kill(process)


def kill(process):
    """Kills a process, if it runs, and all that it started."""
    if process.poll() is None:
        for each in [*psutil.Process(process.pid).children(recursive=True), process]:
            with suppress(psutil.NoSuchProcess):
                each.kill()
        process.wait()


def evaluate(*more):
    """A program that flies missions of 32 batches into o.csv, as a process."""
    command = [sys.executable, "-m", "swarm_mj", "evaluate", "--policy", "tdma", "./mine"]
    command += ["--robots", "4", "--windows", "100", "--channel", "my_channel:Lossy"]
    command += ["--episodes", "400", "--csv", "o.csv", *more]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)


@pytest.fixture
def own(here):
    """A folder with a policy and a channel of one's own."""
    save_tiny(here / "mine")
    code = (ROOT / "README.md").read_text().split("```python\n")[-1]
    (here / "my_channel.py").write_text(code.partition("mission = ")[0])
    return here


def wait_for(num_batches, path, study):
    """Waits until as many batches have been kept."""
    while not path.exists() or len(path.read_bytes().splitlines()) <= num_batches:
        assert study.poll() is None, study.stderr.read()
        time.sleep(0.05)


def test_a_cluster_of_which_a_node_is_killed_writes_what_one_process_writes(own, cluster):
    """Its workers have what the study names in the folder here, and the terminal stays quiet.

    It goes on after Ctrl-C and after the command was killed, too.
    """
    alone = evaluate()
    assert alone.wait() == 0
    expected = (own / "o.csv").read_bytes()
    progress, with_ray = own / "o.csv.progress", ["--engine", "ray", "--address", cluster]
    with node(f"--address={cluster}") as second:
        study = evaluate("--force", *with_ray)
        wait_for(3, progress, study)
        kill(second)
    assert len(progress.read_bytes().splitlines()) < 20  # it is in the middle
    wait_for(7, progress, study)
    study.send_signal(signal.SIGINT)
    assert "--resume" in study.communicate()[1]
    study = evaluate("--force", "--resume", *with_ray)
    wait_for(11, progress, study)
    study.kill()
    study.wait()
    study = evaluate("--force", "--resume", *with_ray)
    assert study.communicate()[1] == ""
    assert study.returncode == 0
    assert (own / "o.csv").read_bytes() == expected


def test_what_a_task_raises_and_other_code_end_a_study(here, cluster, monkeypatch):  # noqa: ARG001
    ray = Ray(address=cluster)
    with pytest.raises(ValueError, match="factorial"):
        list(ray.run(math.factorial, [3, -1]))
    monkeypatch.setattr(engines, "code_digest", lambda: 64 * "0")
    with pytest.raises(OSError, match=r"has other code, digest [0-9a-f]{12}, not 000000000000 as"):
        list(ray.run(math.factorial, [3]))


def test_tasks_start_no_threads_and_leave_signals_as_they_were(here, cluster):  # noqa: ARG001
    before = {number: signal.getsignal(number) for number in INTERRUPTS}
    for ray in (Ray(address=cluster), Ray(num_jobs=2)):
        done = dict(ray.run(os.getenv, [*SURROUNDINGS]))
        assert done == dict(enumerate(SURROUNDINGS.values()))
    assert {number: signal.getsignal(number) for number in INTERRUPTS} == before
