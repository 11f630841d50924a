"""Reads a replay back: whether it is whole, which windows it holds, and what a video shows."""

import shlex
from pathlib import Path

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float, Int
from rerun.chunk import RrdReader

from swarm_mj.replay.arcs import SEGMENTS
from swarm_mj.replay.digest import has_digest
from swarm_mj.replay.footage import Facts, Footage
from swarm_mj.replay.looks import Looks, Surprises, in_turn
from swarm_mj.replay.sheet import TIMELINE
from swarm_mj.replay.shots import LOOKS, Shots, in_order
from swarm_mj.replay.strokes import STROKES
from swarm_mj.system.reading import read_json

FACTS = "footage"  # the recording's property that holds them


def check_replay(path: Path) -> None:
    """Pass for a whole replay; rerun may crash over others, so they are kept from it.

    Raises:
        ValueError: There is no such file, or it is not as `write_replay` left it.
        OSError: The disk fails.
    """
    if not has_digest(path):
        if path.suffix.lower() != ".rrd":
            raise ValueError(f"{path} is no .rrd file; `swarm-mj fly` records them")
        raise ValueError(
            f"{path} is no whole replay: damaged, truncated, or not recorded by this version of "
            f"swarm-mj; record it again, or see what `rerun {shlex.quote(str(path))}` makes of it"
        )


def windows(path: Path) -> Int[np.ndarray, "T"]:
    """Return the numbers of a whole replay's windows, in order; 1 is a mission's first."""
    return _timed(path, "/arena/robots", TIMELINE).to_numpy(zero_copy_only=False).astype(np.int64)


def read_footage(path: Path) -> Footage:
    """What a video shows of a whole replay.

    Raises:
        ValueError: The file is no whole replay, or of an earlier version of swarm-mj.
        OSError: The disk fails.
    """
    check_replay(path)
    try:
        facts = _facts(path)
        shape = (-1, facts.mission.num_robots)
        position_m = _numbers(path, "/scene/robots", "Cylinders3D:centers").reshape(*shape, 3)
        return Footage(
            facts=facts,
            window=windows(path),
            position_m=position_m[..., :2],
            velocity_mps=_headings(path, position_m),
            age=_numbers(path, "/scene/robots", "age").reshape(shape),
            is_cut_off=_is_cut_off(path).reshape(shape),
            looks=_looks(path),
            is_on=_numbers(path, "/scene/robots", "is_on").reshape(shape) > 0.0,
            shots=_shots(path),
            age_mean=_numbers(path, "/plots/age/mean", "Measurements:values"),
        )
    except (KeyError, ValueError, pa.ArrowException) as error:
        raise ValueError(
            f"{path} does not hold what a video shows, as replays of an earlier swarm-mj; record "
            "it again"
        ) from error


def _facts(path: Path) -> Facts:
    chunks = RrdReader(path).stream().filter(content=f"/__properties/{FACTS}")
    (text,) = (chunk.to_record_batch().column("json")[0].as_py()[0] for chunk in chunks)
    return read_json(text, Facts)


def _headings(path: Path, position_m: Float[np.ndarray, "T N 3"]) -> Float[np.ndarray, "T N 2"]:
    """Directions of flight; teams at rest have none."""
    if not _has(path, "/scene/heading"):
        return np.zeros((*position_m.shape[:2], 2))
    ends = _numbers(path, "/scene/heading", "LineStrips3D:strips").reshape(*position_m.shape[:2], 6)
    return ends[..., 3:5] - ends[..., :2]


def _shots(path: Path) -> Shots:
    rows, starts, ends, colours = [], [], [], []
    for fate, (colour, _) in LOOKS.items():
        entity = f"/scene/packets/{fate}"
        if not _has(path, entity):
            continue
        strips = _timed(path, entity, "LineStrips3D:strips")
        points = _flat(strips).to_numpy().reshape(-1, SEGMENTS + 1, 3).astype(float)
        per_window = np.diff(strips.offsets.to_numpy())
        rows.append(np.repeat(np.arange(len(per_window)), per_window))
        starts.append(points[:, 0, :2])
        ends.append(points[:, -1, :2])
        colours.append(np.tile(np.array(colour, dtype=np.uint8), (len(points), 1)))
    return in_order(rows, starts, ends, colours)


def _is_cut_off(path: Path) -> Bool[np.ndarray, "K"]:
    """Of each robot in each window; nobody is in free space, and in files of an earlier version."""
    if _has(path, "/scene/robots", "is_cut_off"):
        return _numbers(path, "/scene/robots", "is_cut_off") > 0.0
    return np.zeros(len(_numbers(path, "/scene/robots", "age")), dtype=bool)


def _looks(path: Path) -> Looks | None:
    """Links that surprise, of missions beyond free space."""
    if not all(_has(path, f"/scene/world/{kind}", "margin_db") for kind in STROKES):
        return None
    found = [_surprises(path, kind) for kind in STROKES]
    window = _timed(path, f"/scene/world/{next(iter(STROKES))}", TIMELINE)
    return Looks(
        window=window.to_numpy(zero_copy_only=False).astype(np.int64), surprises=in_turn(found)
    )


def _surprises(path: Path, kind: str) -> Surprises:
    entity = f"/scene/world/{kind}"
    names = ("sender", "receiver", "loss_db", "margin_db")
    columns = {name: _timed(path, entity, name) for name in names}
    per_look = np.diff(columns["sender"].offsets.to_numpy())
    numbers = {name: _flat(column).to_numpy().astype(np.int16) for name, column in columns.items()}
    row = np.repeat(np.arange(len(per_look)), per_look)
    strokes = Surprises(row=row, is_too_weak=np.full(len(row), kind == "too_weak"), **numbers)
    # Earlier versions drew some links in two pieces, each with the numbers of its link.
    link = np.stack([strokes.row, strokes.sender, strokes.receiver])
    return strokes.chosen(np.any(np.diff(link, prepend=-1), axis=0))


def _has(path: Path, entity: str, component: str = "") -> bool:
    return any(
        not chunk.is_static and component in ("", *chunk.to_record_batch().schema.names)
        for chunk in RrdReader(path).stream().filter(content=entity)
    )


def _numbers(path: Path, entity: str, component: str) -> Float[np.ndarray, "K"]:
    return _flat(_timed(path, entity, component)).to_numpy(zero_copy_only=False).astype(float)


def _flat(column: pa.Array) -> pa.Array:
    """All numbers of nested lists in one row."""
    while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        column = column.flatten()
    return column


def _timed(path: Path, entity: str, component: str) -> pa.Array:
    """Return a component's values in all windows, in order."""
    batches = [
        chunk.to_record_batch()
        for chunk in RrdReader(path).stream().filter(content=entity)
        if not chunk.is_static
    ]
    table = pa.concat_tables(
        pa.Table.from_batches([batch]).select(list({TIMELINE, component}))
        for batch in batches
        if component in batch.schema.names
    )
    return table.sort_by(TIMELINE).column(component).combine_chunks()
