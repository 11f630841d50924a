"""Work on several processes: each takes the next piece when it is done with its last."""

import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext
from multiprocessing.synchronize import Event
from typing import Any, TypeVar

Piece = TypeVar("Piece")
Product = TypeVar("Product")

# Jobs share the machine's cores, so none starts threads of its own.
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}

POLL_S = 0.05  # how often a process that loads is looked at when all is broken off


def run_jobs(
    work: Callable[[Piece], Product], pieces: Sequence[Piece], num_jobs: int
) -> Generator[tuple[int, Product]]:
    """Does all pieces of work.

    Ctrl-C reaches this process only; whoever breaks off ends the others, once they have loaded.

    Args:
        work: A function of a module, which other processes can import.
        pieces: What to do; pickled on the way to another process, as are the products.
        num_jobs: Processes; one is this process itself.

    Yields:
        A piece's index and its product, in the order in which they are done.

    Raises:
        OSError: A process ended before its work did.
        Exception: What `work` raised of the first piece that failed.
    """
    if min(num_jobs, len(pieces)) <= 1:
        yield from ((index, work(piece)) for index, piece in enumerate(pieces))
        return
    waiting = iter(enumerate(pieces))
    under_way: dict[Connection, int] = {}
    context = get_context("spawn")
    with ExitStack() as stack:
        with _shielded():
            each = (_worker(work, context) for _ in range(min(num_jobs, len(pieces))))
            workers = [stack.enter_context(worker) for worker in each]
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
    """Gives a worker the next piece, if there is one."""
    for index, piece in islice(waiting, 1):
        worker.send(piece)
        under_way[worker] = index


def _ready(under_way: dict[Connection, int]) -> list[Connection]:
    """The workers that have something to say, waiting for the first."""
    return [worker for worker in wait(list(under_way)) if isinstance(worker, Connection)]


def _receive(worker: Connection) -> Any:  # noqa: ANN401 - any product
    """A worker's product; raises what its work raised."""
    try:
        product, error = worker.recv()
    except (EOFError, ConnectionError):
        raise OSError("a job was ended from outside, perhaps for want of memory") from None
    if error is not None:
        raise error
    return product


@contextmanager
def _worker(work: Callable[[Any], Any], context: SpawnContext) -> Iterator[Any]:
    """A process that works until the block ends; yields the connection to it."""
    ours, theirs = context.Pipe()
    is_loaded = context.Event()
    process = context.Process(target=_serve, args=(work, theirs, is_loaded), daemon=True)
    process.start()
    theirs.close()  # so that the process's end is heard
    try:
        yield ours
    finally:
        # Libraries run programs of their own while they load, and complain if they are left.
        while process.is_alive() and not is_loaded.wait(POLL_S):
            pass
        process.terminate()
        process.join()


def _serve(work: Callable[[Any], Any], connection: Connection, is_loaded: Event) -> None:
    """A process's life: works until nobody wants it any more."""
    is_loaded.set()
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
    """Processes started within it hear no Ctrl-C, even as they load, and start no more threads."""
    handler, before = signal.signal(signal.SIGINT, signal.SIG_IGN), dict(os.environ)
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name in ONE_THREAD.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)
        signal.signal(signal.SIGINT, handler)
