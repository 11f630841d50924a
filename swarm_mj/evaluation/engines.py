"""Engines: who does the pieces of a study, one protocol for all of them."""

import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context, resource_tracker
from typing import Protocol, TypeVar, runtime_checkable

from swarm_mj.system.interrupt import INTERRUPTS, deferred_interrupt
from swarm_mj.system.processes import guard

Piece = TypeVar("Piece")
Product = TypeVar("Product")

# Jobs share the machine's cores, so none starts threads of its own. And none draws: MuJoCo need not
# look for a window system, which it does by a program that complains if it is left.
SURROUNDINGS = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
# Nor does any import modules of the current folder, as `python -c` would.
SURROUNDINGS |= {"MUJOCO_GL": "disable", "PYTHONSAFEPATH": "1"}


@runtime_checkable
class Engine(Protocol):
    """Does pieces of work in other processes, wherever they are."""

    def run(
        self, work: Callable[[Piece], Product], pieces: Sequence[Piece]
    ) -> Generator[tuple[int, Product]]:
        """Do all pieces; yield each one's index and product once, in the order they are done.

        The processes import `work`; pieces and products are pickled on the way. They end with the
        generator, and with this process, however it ends.

        Raises:
            OSError: Not all pieces could be done.
            Exception: What `work` raised of the first piece that failed.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Local:
    """Processes of this machine; one of `num_jobs` is this process, which alone hears Ctrl-C."""

    num_jobs: int = 1

    def run(
        self, work: Callable[[Piece], Product], pieces: Sequence[Piece]
    ) -> Generator[tuple[int, Product]]:
        """Do all pieces, as `Engine.run` says."""
        num_jobs = min(self.num_jobs, len(pieces))
        if num_jobs <= 1:
            yield from ((index, work(piece)) for index, piece in enumerate(pieces))
            return
        # Forked processes would inherit locks that MuJoCo's threads hold.
        with guard() as watch, ProcessPoolExecutor(num_jobs, get_context("spawn")) as pool:
            with deferred_interrupt() as is_interrupted, _inherited():
                futures = {pool.submit(work, piece): index for index, piece in enumerate(pieces)}
                # The pool leaves its processes waiting for work for ever if this one is killed.
                for process in pool._processes.values():
                    watch(process.pid or 0)
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


@contextmanager
def _inherited() -> Iterator[None]:
    """Let processes that are started meanwhile inherit SURROUNDINGS, and a mask against Ctrl-C."""
    before = dict(os.environ)
    os.environ.update(SURROUNDINGS)
    resource_tracker.ensure_running()  # multiprocessing's; to start it lifts all masks
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name in SURROUNDINGS.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)
