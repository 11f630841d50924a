"""The progress file: batches already flown, so that an interruption loses no more than one.

Whole lines of JSON: first what the batches depend on, then one batch a line as it gets done. JSON
gives floats back as they were, so a resumed evaluation ends in the same files.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec

from swarm_mj.evaluation.batch import BatchCosts


def progress_path(output: Path) -> Path:
    """Where the progress towards an output is kept: beside it."""
    return output.with_name(f"{output.name}.progress")


def start(path: Path, header: dict[str, Any]) -> None:
    """Begins a progress file, in place of any other; raises OSError if that cannot be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(_line(header))


def append(path: Path, index: int, costs: BatchCosts) -> None:
    """Adds what a batch cost, by its index among the study's; raises OSError if that cannot be."""
    with path.open("ab") as file:
        file.write(_line({"batch": index, "costs": asdict(costs)}))


def resume(path: Path, header: dict[str, Any]) -> dict[int, BatchCosts]:
    """What an interrupted evaluation has flown, by the batches' indices.

    A line that was cut off is dropped from the file; it is begun anew if not even its header, what
    the batches depend on, was written.

    Raises:
        ValueError: The batches depended on something else, or the file is none of this kind.
        OSError: The file cannot be read or written.
    """
    whole, _, cut_off = path.read_bytes().rpartition(b"\n")
    if not whole:
        start(path, header)
        return {}
    first, *lines = whole.split(b"\n")
    try:
        before = msgspec.json.decode(first, type=dict[str, Any])
        batches = [msgspec.json.decode(line, type=_Batch) for line in lines]
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(
            f"progress {path} is damaged; start over with --force instead of --resume"
        ) from error
    if difference := _difference("", before, header):
        raise ValueError(
            f"progress {path} is of another evaluation: {difference}; repeat that one, or start "
            "over with --force instead of --resume"
        )
    if cut_off:
        path.write_bytes(whole + b"\n")
    return {batch.batch: batch.costs for batch in batches}


class _Batch(msgspec.Struct):
    """A line of the file."""

    batch: int
    costs: BatchCosts


def _line(content: dict[str, Any]) -> bytes:
    return json.dumps(content, allow_nan=False).encode() + b"\n"


def _difference(name: str, before: object, now: object) -> str:
    """Where two pieces of JSON first differ, in words; empty if nowhere."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = dict.fromkeys([*now, *before])
        found = (_difference(key, before.get(key), now.get(key)) for key in keys)
        return next(filter(None, found), "")
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        found = (_difference(name, *pair) for pair in zip(before, now, strict=True))
        return next(filter(None, found), "")
    if isinstance(before, list) and isinstance(now, list):
        return f"it has {len(before)} {name}, not {len(now)}"
    return "" if before == now else f"its {name} is {before!r}, not {now!r}"
