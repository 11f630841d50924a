"""Work on several processes: each takes the next piece when it is done with its last."""

import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, resource_tracker
from typing import TypeVar

from swarm_mj.system.interrupt import INTERRUPTS, deferred_interrupt
from swarm_mj.system.processes import guard

Piece = TypeVar("Piece")
Product = TypeVar("Product")

# Jobs share the machine's cores, so none starts threads of its own. And none draws: MuJoCo need not
# look for a window system, which it does by a program that complains if it is left.
SURROUNDINGS = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
# Nor does any run what lies in the folder one stands in, as `python -c` would.
SURROUNDINGS |= {"MUJOCO_GL": "disable", "PYTHONSAFEPATH": "1"}


def run_jobs(
    work: Callable[[Piece], Product], pieces: Sequence[Piece], num_jobs: int
) -> Generator[tuple[int, Product]]:
    """Do all pieces of work; yield each one's index and product, in the order they are done.

    One of `num_jobs` is this process itself. Others import `work`, and pieces and products are
    pickled on the way. Ctrl-C reaches this process only; the others end with it, however it ends.

    Raises:
        OSError: A process ended before its work did.
        Exception: What `work` raised of the first piece that failed.
    """
    num_jobs = min(num_jobs, len(pieces))
    if num_jobs <= 1:
        yield from ((index, work(piece)) for index, piece in enumerate(pieces))
        return
    # Forked processes would inherit locks that MuJoCo's threads hold.
    with guard() as watch, ProcessPoolExecutor(num_jobs, get_context("spawn")) as pool:
        with deferred_interrupt() as is_interrupted, _inherited():
            futures = {pool.submit(work, piece): index for index, piece in enumerate(pieces)}
            # The pool itself leaves its processes waiting for work for ever if this one is killed.
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
