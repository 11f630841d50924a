"""The progress file: batches already flown, so that an interruption loses no more than one.

Whole lines, each a digest and JSON: first what the batches depend on, then one batch a line as it
gets done. A line's digest is of the first line's JSON and its own, so it shows a line of another
evaluation as well as damage, and what passes needs no other check. JSON gives floats back as they
were, so a resumed evaluation ends in the same files.
"""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.system.reading import read_file, read_json
from swarm_mj.system.writing import append_bytes, write_bytes

DIGEST_DIGITS = 16
MAX_BYTES = 2**32  # four times what 100 000 missions of 40 policies take


@dataclass(frozen=True, kw_only=True)
class _Flown:
    # A line of the file but the first.
    batch: int
    costs: BatchCosts


def progress_path(output: Path) -> Path:
    """Return where the progress towards an output is kept: beside it."""
    return output.with_name(f"{output.name}.progress")


def start(path: Path, header: dict[str, Any]) -> None:
    """Begin a progress file, in place of any other; raise OSError if that cannot be."""
    write_bytes(path, _line(b"", _json(header)))


def append(path: Path, header: dict[str, Any], index: int, costs: BatchCosts) -> None:
    """Add what a batch cost, by its index among the study's; raise OSError if that cannot be."""
    append_bytes(path, _line(_json(header), _json({"batch": index, "costs": asdict(costs)})))


def resume(path: Path, header: dict[str, Any]) -> dict[int, BatchCosts]:
    """Return what an interrupted evaluation with this header has flown, by the batches' indices.

    A line that was cut off is dropped from the file; it is begun anew if not even its header, what
    the batches depend on, was written.

    Raises:
        ValueError: The batches depended on something else, or the file is damaged or none of this
            kind.
        OSError: The file cannot be read or written.
    """
    content = read_file(path, "progress", MAX_BYTES)
    whole, _, cut_off = content.rpartition(b"\n")
    if not whole and _line(b"", _json(header)).startswith(cut_off):
        start(path, header)
        return {}
    lines = [line.partition(b" ")[2] for line in whole.split(b"\n")]
    try:
        before = read_json(lines[0], dict)
        digested = [_line(b"" if line is lines[0] else lines[0], line) for line in lines]
        if b"".join(digested) != whole + b"\n":
            raise ValueError("a line does not have its digest")
        flown = [read_json(line, _Flown) for line in lines[1:]]
    except ValueError as error:
        raise ValueError(
            f"progress {path} is damaged, or of another version; start over with --force instead "
            "of --resume"
        ) from error
    if difference := next(_differences("", before, header), ""):
        raise ValueError(
            f"progress {path} is of another evaluation: {difference}; repeat that one, or start "
            "over with --force instead of --resume"
        )
    if cut_off:
        write_bytes(path, whole + b"\n")
    return {each.batch: each.costs for each in flown}


def _line(first: bytes, text: bytes) -> bytes:
    """Return a line of JSON with its digest; `first` is the JSON of the file's first line."""
    return b"%b %b\n" % (hashlib.sha256(first + text).hexdigest()[:DIGEST_DIGITS].encode(), text)


def _json(content: dict[str, Any]) -> bytes:
    return json.dumps(content, allow_nan=False).encode()


def _differences(name: str, before: object, now: object) -> Iterator[str]:
    """Say in words where two pieces of JSON differ."""
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
