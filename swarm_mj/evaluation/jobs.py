"""Work on several processes: each takes the next piece when it is done with its last."""

import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext
from typing import Any, TypeVar

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
    """Do all pieces of work.

    Ctrl-C reaches this process only; the others end with it, however it ends.

    Args:
        work: A function of a module, which other processes can import.
        pieces: What to do; pickled on the way to another process, as are the products.
        num_jobs: Processes; one is this process itself.

    Yields:
        A piece's index and its product, in the order in which they are done.

    Raises:
        ValueError: There is no process to do it.
        OSError: A process ended before its work did.
        Exception: What `work` raised of the first piece that failed.
    """
    if num_jobs < 1:
        raise ValueError(f"work needs 1 process or more, not {num_jobs}")
    if min(num_jobs, len(pieces)) <= 1:
        yield from ((index, work(piece)) for index, piece in enumerate(pieces))
        return
    waiting = iter(enumerate(pieces))
    under_way: dict[Connection, int] = {}
    context = get_context("spawn")
    with ExitStack() as stack:
        watch = stack.enter_context(guard())
        with _surrounded():
            resource_tracker.ensure_running()  # multiprocessing's; to start it lifts all shields
        with deferred_interrupt() as is_interrupted, _shielded(), _surrounded():
            each = (_worker(work, context, watch) for _ in range(min(num_jobs, len(pieces))))
            workers = [stack.enter_context(worker) for worker in each]
        if is_interrupted():
            raise KeyboardInterrupt
        for worker in workers:
            _hand_out(waiting, worker, under_way)
        while under_way:
            for worker in _ready(under_way):
                index, product = under_way.pop(worker), _receive(worker)
                _hand_out(waiting, worker, under_way)
                yield index, product


def _hand_out(
    waiting: Iterator[tuple[int, Any]], worker: Connection, under_way: dict[Connection, int]
) -> None:
    """Give a worker the next piece, if there is one."""
    for index, piece in islice(waiting, 1):
        worker.send(piece)
        under_way[worker] = index


def _ready(under_way: dict[Connection, int]) -> list[Connection]:
    """Return the workers that have something to say, waiting for the first."""
    return [worker for worker in wait(list(under_way)) if isinstance(worker, Connection)]


def _receive(worker: Connection) -> Any:  # noqa: ANN401 - any product
    """Return a worker's product; raises what its work raised."""
    try:
        product, error = worker.recv()
    except (EOFError, ConnectionError):
        raise OSError("a job was ended from outside, perhaps for want of memory") from None
    if error is not None:
        raise error
    return product


@contextmanager
def _worker(
    work: Callable[[Any], Any], context: SpawnContext, watch: Callable[[int], None]
) -> Iterator[Any]:
    """Return a process that works until the block ends; yields the connection to it."""
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(work, theirs), daemon=True)
    process.start()
    theirs.close()  # so that the process's end is heard
    try:
        watch(process.ident or 0)
        yield ours
    finally:
        process.kill()
        process.join()


def _serve(work: Callable[[Any], Any], connection: Connection) -> None:
    """Return a process's life: works until nobody wants it any more."""
    with suppress(EOFError, ConnectionError):
        while True:
            piece = connection.recv()
            try:
                reply = work(piece), None
            except Exception as error:
                reply = None, error
            connection.send(reply)


@contextmanager
def _shielded() -> Iterator[None]:
    """Process started within it hear no Ctrl-C, even as they load."""
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def _surrounded() -> Iterator[None]:
    """Process started within it start no more threads, draw nothing, load nothing from here."""
    before = dict(os.environ)
    os.environ.update(SURROUNDINGS)
    try:
        yield
    finally:
        for name in SURROUNDINGS.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)
