"""Engines: who does the pieces of a study, one protocol for all of them."""

import os
import shutil
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any, Literal, Protocol, TypeVar, get_args, runtime_checkable

from swarm_mj.evaluation.study import Study
from swarm_mj.policies.registry import stored_policies
from swarm_mj.system.fields import check, setting
from swarm_mj.system.interrupt import INTERRUPTS, deferred_interrupt
from swarm_mj.system.packages import code_digest, need
from swarm_mj.system.processes import HAS_GROUPS, SAFE_PATH, guard
from swarm_mj.system.user_code import is_users

Piece = TypeVar("Piece")  # of a study's work
Product = TypeVar("Product")  # what was made of a piece
Work = Callable[[Piece], Product]
Done = Generator[tuple[int, Product]]  # pieces' indices and products
Share = Sequence[tuple[int, Piece]]  # a job's pieces, with their indices
Returned = list[tuple[int, Product]] | Exception  # a job's products, or what went wrong
EngineName = Literal["local", "ray", "slurm"]

# Jobs share the machine's cores, so none starts threads of its own. And none draws: MuJoCo need not
# look for a window system, which it does by a program that complains if it is left.
SURROUNDINGS = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
# Nor does any import modules of the current folder, as `python -c` would.
SURROUNDINGS |= {"MUJOCO_GL": "disable", SAFE_PATH: "1"}
# Ray sends nothing to its makers, and does not warn of GPUs.
QUIET = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
PROCESSES = "processes that fly missions"  # the options' heading
MAX_ARRAY = 1000  # SLURM's usual limit of jobs in an array
ATTEMPTS = 3  # how often a job is submitted
JOB_NAME = "swarm-mj"  # as `squeue` shows it


@runtime_checkable
class Engine(Protocol):
    """Does pieces of work in other processes, wherever they are."""

    def run(self, work: Work[Piece, Product], pieces: Sequence[Piece]) -> Done[Product]:
        """Do all pieces; yield each one's index and product once, in the order they are done.

        The processes import `work`; pieces and products are pickled on the way. They end with the
        generator, and with this process, however it ends. Raises OSError if not all pieces could
        be done, or what `work` raised of the first that failed.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Local:
    """Processes of this machine; one of `num_jobs` is this process, which alone hears Ctrl-C."""

    num_jobs: int = 1

    def run(self, work: Work[Piece, Product], pieces: Sequence[Piece]) -> Done[Product]:
        """Do all pieces, as `Engine.run` says."""
        num_jobs = min(self.num_jobs, len(pieces))
        if num_jobs <= 1:
            yield from ((index, work(piece)) for index, piece in enumerate(pieces))
            return
        context = get_context("spawn")  # forked ones would inherit locks that MuJoCo's threads hold
        gate, opener = context.Pipe(duplex=False)
        processes = ProcessPoolExecutor(
            max_workers=num_jobs,
            mp_context=context,
            initializer=partial(_wait_at, gate) if HAS_GROUPS else None,
        )
        # The gate ends before the pool does, which would wait for processes that wait at it.
        with guard() as watch, processes as pool, gate, opener:
            with deferred_interrupt() as is_interrupted, _inherited():
                futures = {pool.submit(work, piece): index for index, piece in enumerate(pieces)}
                # The pool leaves its processes waiting for work for ever if this one is killed.
                for process in pool._processes.values():
                    watch(process.pid or 0)
                if HAS_GROUPS:
                    os.write(opener.fileno(), bytes(num_jobs))
            try:
                if is_interrupted():
                    raise KeyboardInterrupt
                for future in as_completed(futures):
                    yield futures[future], future.result()
            except BrokenProcessPool:
                raise OSError("a job was ended from outside, perhaps for want of memory") from None
            finally:
                for process in list(pool._processes.values()):
                    process.kill()  # without waiting for the pieces under way


def _wait_at(gate: Any) -> None:  # noqa: ANN401 - a pipe's end, of another class on Windows
    """Let a process of a pool begin with nothing before it is sure to end with its parent."""
    if not os.read(gate.fileno(), 1):  # the parent ended before it opened the gate
        os._exit(1)


@dataclass(frozen=True, kw_only=True)
class Ray:
    """Tasks of the Ray cluster at `address`, or of one of `num_jobs` CPUs that is started here."""

    num_jobs: int = 1
    address: str | None = None
    files: Sequence[Path] = ()  # that pieces name

    def run(self, work: Work[Piece, Product], pieces: Sequence[Piece]) -> Done[Product]:
        """Do all pieces, as `Engine.run` says."""
        os.environ.update(QUIET)
        ray: Any = import_module("ray")
        try:
            # Its end puts back the handlers of signals that Ray replaces.
            with deferred_interrupt() as is_interrupted, TemporaryDirectory() as parts:
                _copy_parts(parts, self.files)
                self._start(ray, parts)
            if is_interrupted():
                raise KeyboardInterrupt
            do = ray.remote(max_retries=-1)(_do)
            code = code_digest()
            left = enumerate(pieces)
            tasks = []
            while True:
                # Never a million tasks at once, and as many CPUs as there are by now.
                num_tasks = 2 * int(ray.cluster_resources().get("CPU", 0)) + 1
                more = islice(left, max(0, num_tasks - len(tasks)))
                tasks += [do.remote(work, code, [piece]) for piece in more]
                if not tasks:
                    return
                done, tasks = ray.wait(tasks)
                yield from _unpacked(ray.get(done[0]))
        except (ray.exceptions.RayError, RuntimeError) as error:
            raise OSError(f"Ray gave up: {' '.join(str(error).split())}") from error
        finally:
            ray.shutdown()

    def _start(self, ray: Any, parts: str) -> None:  # noqa: ANN401 - a module
        """Start Ray, or join one; raise OSError in one line if that cannot be."""
        try:
            ray.init(
                address=self.address or "local",
                # A cluster that runs already has the processors that it has.
                num_cpus=None if self.address else self.num_jobs,
                runtime_env={"working_dir": parts, "env_vars": SURROUNDINGS},
                logging_level="ERROR",
                log_to_driver=False,
            )
        except Exception as error:  # Ray raises that very class, among others
            raise OSError(f"Ray did not start: {' '.join(str(error).split())}") from error


@dataclass(frozen=True, kw_only=True)
class Slurm:
    """Arrays of SLURM's jobs, `num_jobs` at a time; what fails is submitted again."""

    num_jobs: int = 1
    cluster: str = "slurm"  # or submitit's "local": processes here

    def run(self, work: Work[Piece, Product], pieces: Sequence[Piece]) -> Done[Product]:
        """Do all pieces, as `Engine.run` says."""
        submitit: Any = import_module("submitit")
        folder = mkdtemp(prefix="slurm-", dir=Path.cwd())  # which all machines see
        executor = submitit.AutoExecutor(folder, cluster=self.cluster)
        setup = [f"export {name}={value}" for name, value in SURROUNDINGS.items()]
        executor.update_parameters(
            name=JOB_NAME,
            slurm_wckey=JOB_NAME,  # the key by which a site may account for work
            slurm_array_parallelism=self.num_jobs,
            timeout_min=24 * 60,
            slurm_setup=setup,
        )
        left = dict(enumerate(pieces))
        for _ in range(ATTEMPTS):
            # Each job of the array does every MAX_ARRAY-th piece.
            num_shares = min(len(left), MAX_ARRAY)
            shares = [list(left.items())[k::MAX_ARRAY] for k in range(num_shares)]
            try:
                jobs = executor.map_array(partial(_do, work, code_digest()), shares)
            except RuntimeError as error:
                raise OSError(f"sbatch takes no jobs: {str(error).strip()}") from error
            for index, product in _finished(jobs, submitit.helpers.as_completed(jobs, None, 1)):
                del left[index]
                yield index, product
            if not left:
                shutil.rmtree(folder)
                return
        raise OSError(f"{len(left)} pieces failed {ATTEMPTS} times; the logs are in {folder}")


@runtime_checkable
class SlurmJob(Protocol[Product]):
    """A job of submitit's, as far as it is used here."""

    def exception(self) -> Exception | None:
        """Return why the job failed, if it did."""
        ...

    def result(self) -> Returned[Product]:
        """Return what the job brought."""
        ...

    def done(self) -> bool:
        """Return whether it has ended."""
        ...

    def cancel(self, check: bool = True) -> None:
        """End it."""
        ...


def _finished(
    jobs: Sequence[SlurmJob[Product]], completed: Iterable[SlurmJob[Product]]
) -> Done[Product]:
    """Yield what submitit's jobs did; cancel those that are left if the generator is closed."""
    try:
        for job in completed:
            if not job.exception():
                yield from _unpacked(job.result())
    finally:
        for job in jobs:
            if not job.done():
                job.cancel(check=False)


_worker_code = cache(code_digest)  # a worker hashes its code once, not once a piece


def _do(work: Work[Piece, Product], code: str, share: Share[Piece]) -> Returned[Product]:
    """Return pieces' indices and products in another process, or what went wrong."""
    if _worker_code() != code:
        other = f"{socket.gethostname()} has other code, digest {_worker_code():.12}"
        return OSError(f"{other}, not {code:.12} as here; install the same on all machines")
    try:
        return [(index, work(piece)) for index, piece in share]
    except Exception as error:
        error.add_note(traceback.format_exc())  # which is lost on the way
        return error


def _unpacked(done: Returned[Product]) -> list[tuple[int, Product]]:
    if isinstance(done, Exception):
        raise done
    return done


def _copy_parts(folder: str, files: Sequence[Path]) -> None:
    """Copy modules of the user's that are loaded, and files, from the current folder."""
    paths = list(files)
    for name, module in list(sys.modules.items()):
        if is_users(name) and not name.startswith("swarm_mj"):
            paths.append(Path(str(module.__file__)))
    for path in paths:
        target = Path(folder, os.path.relpath(path))
        if os.path.isfile(path) and ".." not in target.parts:  # torch's are no files
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """Who flies a study's missions."""

    jobs: int = setting(1, "how many at once", low=1, high=256, is_common=True, group=PROCESSES)
    engine: EngineName = setting(
        "local", "who starts them", choices=get_args(EngineName), group=PROCESSES
    )
    address: str | None = setting(
        None, "a running Ray's", metavar="auto|HOST:PORT", group=PROCESSES
    )

    @property
    def jobs_here(self) -> int:
        """How many processes fly on this machine, as far as is known."""
        return self.jobs if self.engine == "local" else 1

    def engine_for(self, study: Study) -> Engine:
        """Return the engine of a study; raise ValueError for what is not known or does not fit."""
        return self.engine_with(stored_policies(study.policies))

    def engine_with(self, policies: Sequence[Path]) -> Engine:
        """Return the engine of work that names stored policies; raise as `engine_for`."""
        check(self)
        if self.address and self.engine != "ray":
            raise ValueError(f"address {self.address} is of a Ray cluster; add --engine ray")
        if self.engine == "ray":
            need("ray", "the engine ray")
            from swarm_mj.policies.stored import find_policy  # not in the core

            files = [find_policy(path) for path in policies]
            return Ray(num_jobs=self.jobs, address=self.address, files=files)
        if self.engine == "local":
            return Local(num_jobs=self.jobs)
        need("submitit", "the engine slurm")
        if not shutil.which("sbatch"):
            raise OSError("there is no sbatch here; --engine slurm needs a machine that has it")
        return Slurm(num_jobs=self.jobs)


@contextmanager
def _inherited() -> Iterator[None]:
    """Let processes that are started meanwhile inherit SURROUNDINGS, and a mask against Ctrl-C."""
    before = dict(os.environ)
    os.environ.update(SURROUNDINGS)
    try:
        with _masked():
            yield
    finally:
        for name in SURROUNDINGS.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)


@contextmanager
def _masked() -> Iterator[None]:
    """Let processes that are started meanwhile inherit a mask against Ctrl-C, if there are any."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows, which has no resource tracker either
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # multiprocessing's; to start it lifts all masks
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
