"""The flights of a study, kept one by one, so that a study can be resumed.

The progress file holds whole lines, each a digest and JSON: first what the batches depend on, then
one batch a line, its index and its costs. A line's digest is of the first line's JSON and its own,
so it shows a line of another evaluation as well as damage, and what passes needs no other check.
JSON gives floats back as they were, so a resumed evaluation ends in the same files.
"""

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path

import msgspec
import numpy as np
from rich.console import Console

from swarm_mj.evaluation.batch import BatchCosts, fly_batch
from swarm_mj.evaluation.engines import Engine, Local
from swarm_mj.evaluation.study import Study
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.reading import read_file
from swarm_mj.system.terminal import WorkBar
from swarm_mj.system.writing import append_bytes, write_bytes

MAX_BYTES = 2**32  # four times what 100 000 missions of 40 policies take


def num_flown(study: Study, costs: Mapping[int, BatchCosts]) -> int:
    """Return how many of a study's missions have been flown."""
    return sum(len(study.batches[index].seeds) for index in costs)


def fly_study(
    study: Study,
    costs: dict[int, BatchCosts],
    engine: Engine,
    keep: Callable[[int, BatchCosts], None] | None,
    console: Console,
    *,
    line_every_s: float = math.inf,
) -> None:
    """Fly the batches that `costs` lacks, while a bar shows how far it is.

    Args:
        study: What is to be flown.
        costs: What has been flown, by the batches' indices in `study.batches`; others are added.
        engine: What flies the batches, here or on other machines.
        keep: Stores a batch's costs, by its index; None if they need not outlive the process.
        console: Where the bar is drawn.
        line_every_s: How often, at most, a line says so where the console is no terminal [s].

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed; `costs` has all batches that were flown.
    """
    left = [index for index in range(len(study.batches)) if index not in costs]
    # With nothing left, no cluster is started.
    starts = engine if left else Local()
    # Batches come back in any order, each with its place in what the engine was given.
    flown = starts.run(fly_batch, [study.batches[index] for index in left])
    done = num_flown(study, costs)
    bar = WorkBar(
        "Flying",
        study.num_missions,
        "missions",
        completed=done,
        console=console,
        line_every_s=line_every_s,
    )
    with bar, closing(flown):
        for which, batch_costs in flown:
            index = left[which]
            # Ctrl-C between the two would leave a batch in `costs` that no file has.
            with deferred_interrupt() as is_interrupted:
                costs[index] = batch_costs
                if keep:
                    keep(index, batch_costs)
            if is_interrupted():
                raise KeyboardInterrupt
            bar.advance(len(study.batches[index].seeds))


def progress_path(output: Path) -> Path:
    """Return where the progress towards an output is kept: beside it."""
    return output.with_name(f"{output.name}.progress")


def start_progress(path: Path, header: Mapping[str, object]) -> None:
    """Begin a progress file, in place of any other; raise OSError if that cannot be."""
    write_bytes(path, _first_line(msgspec.json.encode(header)))


def append_progress(
    path: Path, header: Mapping[str, object], index: int, costs: BatchCosts
) -> None:
    """Add what a batch cost, by its index among the study's; raise OSError if that cannot be."""
    lists = {name: numbers.tolist() for name, numbers in vars(costs).items()}
    text = msgspec.json.encode([index, lists])
    append_bytes(path, _later_line(msgspec.json.encode(header), text))


def resume_progress(path: Path, header: Mapping[str, object]) -> dict[int, BatchCosts]:
    """Return what an interrupted evaluation has flown.

    A line that was cut off is dropped from the file; it is begun anew if not even its header was
    written.

    Args:
        path: The progress file.
        header: What the batches depend on now, as `Study.header` returns it.

    Returns:
        The batches' costs by their indices.

    Raises:
        ValueError: The batches depended on something else, or the file is damaged or none of this
            kind.
        OSError: The file cannot be read or written.
    """
    content = read_file(path, "progress", MAX_BYTES)
    whole, _, cut_off = content.rpartition(b"\n")
    if not whole and _first_line(msgspec.json.encode(header)).startswith(cut_off):
        start_progress(path, header)
        return {}
    # Each line's JSON, without its digest: the header's, and one for each batch flown.
    first, *rows = [line.partition(b" ")[2] for line in whole.split(b"\n")]
    expected = _first_line(first)
    expected += b"".join(_later_line(first, row) for row in rows)
    if expected != whole + b"\n":
        raise ValueError(
            f"progress {path} is damaged, or of another version; start over with --force instead "
            "of --resume"
        )
    difference = next(_differences("", msgspec.json.decode(first), header), "")
    if difference:
        raise ValueError(
            f"progress {path} is of another evaluation: {difference}; repeat that one, or start "
            "over with --force instead of --resume"
        )
    if cut_off:
        write_bytes(path, whole + b"\n")
    # The digests have shown that this very code wrote the lines.
    flown: dict[int, BatchCosts] = {}
    for row in rows:
        index, lists = msgspec.json.decode(row)
        flown[index] = _batch_costs(lists)
    return flown


def _batch_costs(lists: dict[str, list[float | None]]) -> BatchCosts:
    """Return costs from JSON's lists; `null` is nan. All are floats but for counts of ages."""
    arrays: dict[str, np.ndarray] = {}
    for name, values in lists.items():
        arrays[name] = np.array(values, np.int64 if name == "ages" else np.float64)
    return BatchCosts(**arrays)


def _first_line(text: bytes) -> bytes:
    """Return a file's first line: the digest of its JSON, and the JSON."""
    return b"%b %b\n" % (_digest(text), text)


def _later_line(first: bytes, text: bytes) -> bytes:
    """Return another line, whose digest is of the first line's JSON as well."""
    return b"%b %b\n" % (_digest(first + text), text)


def _digest(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest()[:16].encode()


def _differences(name: str, before: object, now: object) -> Iterator[str]:
    """Yield a sentence for each difference between two headers, or parts of them, as JSON has them.

    Keys come in the order of the later header, so that the first sentence is of what matters most.
    """
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*now, *before]):
            yield from _differences(key, before.get(key), now.get(key))
    elif isinstance(before, list) and isinstance(now, list):
        if len(before) != len(now):
            yield f"it has {len(before)} {name}, not {len(now)}"
        for pair in zip(before, now, strict=False):
            yield from _differences(name, *pair)
    elif before != now:
        yield f"its {name} is {before!r:.80}, not {now!r:.80}"
