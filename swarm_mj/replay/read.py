"""Reads a replay back: whether it is whole, its windows, what a video shows or an export writes.

Rerun's format has no checksum of what it holds, so a replay ends in a digest: a second recording
stream that is empty but for a field that rerun passes over. It repeats the first stream's footer,
so that rerun finds it where it looks.
"""

import hashlib
import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from jaxtyping import Float, Int
from rerun.chunk import RrdReader

from swarm_mj.mission.geometry import PLANE
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW
from swarm_mj.replay import layers, palette
from swarm_mj.replay.bodies import body_of
from swarm_mj.replay.export.flown import FlownWindows
from swarm_mj.replay.footage import Facts, Footage, shown_ground
from swarm_mj.replay.layer_kinds import Entity, Lines3D, of_others
from swarm_mj.replay.links import (
    LINK,
    NO_MISMATCH,
    NUMBERS,
    SEGMENTS,
    LinkMismatch,
    LinkRows,
    PacketPaths,
    flattened,
    lifted,
)
from swarm_mj.replay.palette import Fate, LinkKind
from swarm_mj.replay.rerun_log import TIMELINE
from swarm_mj.system.reading import open_file, read_json

FACTS = "footage"  # the recording's property that holds them
HEADER_BYTES = 12  # at the beginning of a stream
FOOTER_BYTES = 32  # at its end
FOOTER = b"RRF2FOOT\x01\x00\x00\x00"  # the end of the footer
END = (0).to_bytes(8, "little")  # the kind of a stream's last message
FIELD = b"\xfa\x7f\x20"  # protobuf's tag of field 2047, and the length of a SHA-256
SEAL_BYTES = HEADER_BYTES + len(END) + 8 + len(FIELD) + 32 + FOOTER_BYTES

SHOWN = (layers.SCENE.contents, f"/{layers.MEAN_AGE.path}")  # all that a video shows

# Components that change, by their entity's path and their name; one row per window.
Columns = dict[tuple[str, str], pa.Array]


def with_digest(recorded: bytes) -> bytes:
    """Return a recording and its digest; raise OSError if rerun did not write its end."""
    if not recorded.endswith(FOOTER):
        raise OSError("rerun did not record the replay to its end")
    return recorded + _seal(memoryview(recorded))


def _seal(recorded: memoryview) -> bytes:
    field = FIELD + hashlib.sha256(recorded).digest()
    header = recorded[:HEADER_BYTES]
    footer = recorded[-FOOTER_BYTES:]
    return b"".join([header, END, len(field).to_bytes(8, "little"), field, footer])


def check_replay(path: Path) -> None:
    """Raise ValueError unless a file is as `write_replay` left it: rerun may crash over others."""
    with open_file(path, "replay") as file:
        content = file.read()
    if content[-SEAL_BYTES:] != _seal(memoryview(content)[:-SEAL_BYTES]):
        why = "damaged, truncated, or not recorded by this version of swarm-mj"
        ways = f"by `swarm-mj fly`, or see what `rerun {shlex.quote(str(path))}` makes of it"
        raise ValueError(f"{path} is no whole replay: {why}; record it again {ways}")


def windows(path: Path) -> Int[np.ndarray, "T"]:
    """Return the numbers of a whole replay's windows, in order; 1 is a mission's first."""
    return _windows(_columns(path, SHOWN), layers.SCENE_ROBOTS)


def read_footage(path: Path) -> Footage:
    """Return what a video shows; raise as `check_replay`, for replays of earlier versions, too."""
    check_replay(path)
    try:
        return _footage(_facts(path), _columns(path, SHOWN))
    except (KeyError, ValueError, pa.ArrowException) as error:
        lack = "does not hold what a video shows, as replays of an earlier swarm-mj"
        raise ValueError(f"{path} {lack}; record it again") from error


def read_flown(path: Path) -> FlownWindows:
    """Return what an export writes; raise as `read_footage`, and if no packets are kept by slot."""
    footage = read_footage(path)
    columns = _columns(path, [layers.AGE_PLOT.contents, f"/{layers.PACKETS.path}"])
    packets = layers.PACKETS.path
    if (packets, "recipient") not in columns:
        lack = "does not keep its packets by slot, as replays of an earlier swarm-mj"
        raise ValueError(f"{path} {lack}; record it again")
    variance = _numbers(columns[layers.MEAN_AGE.path, "Measurements:variances"])
    shape = (len(footage.window), SLOTS_PER_WINDOW, footage.facts.mission.num_robots)
    return FlownWindows(
        footage=footage,
        recipient=_numbers(columns[packets, "recipient"]).astype(int).reshape(shape),
        heard=_numbers(columns[packets, "heard"]).astype(int).reshape(shape),
        age_std=np.sqrt(variance),
        age_worst=_numbers(columns[layers.WORST_AGE.path, "Scalars:scalars"]),
    )


def _facts(path: Path) -> Facts:
    chunks = RrdReader(path).stream().filter(content=f"/__properties/{FACTS}")
    (text,) = (chunk.to_record_batch().column("json")[0].as_py()[0] for chunk in chunks)
    return read_json(text, Facts)


def _footage(facts: Facts, columns: Columns) -> Footage:
    robots = layers.SCENE_ROBOTS.path
    age = _numbers(columns[robots, "age"]).reshape(-1, facts.mission.num_robots)
    centres_m = _numbers(columns[robots, "Cylinders3D:centers"]).reshape(*age.shape, 3)
    position_m = centres_m[..., :PLANE]
    is_on = _numbers(columns[robots, "is_on"]).reshape(age.shape) > 0.0
    velocity_mps = np.zeros((*age.shape, 2))
    height_m = attitude = None
    if facts.mission.has_bodies:
        height_m, attitude = _bodies(columns, facts.mission.num_robots)
    headings = columns.get((layers.SCENE_HEADINGS.path, "LineStrips3D:strips"))
    if headings is not None:  # teams at rest have none
        start_m, end_m = np.moveaxis(_numbers(headings).reshape(*age.shape, 2, 3), 2, 0)
        velocity_mps = (end_m - start_m)[..., :PLANE]
    is_cut_off = np.zeros(age.shape, dtype=bool)
    cut_off = columns.get((robots, "is_cut_off"))
    if cut_off is not None:  # in free space no robot is
        is_cut_off = _numbers(cut_off).reshape(age.shape) > 0.0
    return Footage(
        facts=facts,
        window=_windows(columns, layers.SCENE_ROBOTS),
        position_m=position_m,
        velocity_mps=velocity_mps,
        known_age=age,
        is_cut_off=is_cut_off,
        mismatch=_mismatch(columns),
        is_on=is_on,
        packets=_packets(columns, position_m, height_m),
        age_mean=_numbers(columns[layers.MEAN_AGE.path, "Measurements:values"]),
        ground=shown_ground(position_m, facts.mission),
        height_m=height_m,
        attitude=attitude,
    )


def _columns(path: Path, contents: Sequence[str]) -> Columns:
    # In one pass: each reader decodes the file anew.
    found: dict[tuple[str, str], list[pa.Table]] = {}
    for chunk in RrdReader(path).stream().filter(content=list(contents), is_static=False):
        table = pa.table(chunk.to_record_batch())
        entity = chunk.entity_path.removeprefix("/")
        for name in table.schema.names:
            column = table.select(list({TIMELINE, name}))
            found.setdefault((entity, name), []).append(column)
    columns: Columns = {}
    for (entity, name), tables in found.items():
        whole = pa.concat_tables(tables).sort_by(TIMELINE)
        columns[entity, name] = whole.column(name).combine_chunks()
    return columns


def _bodies(
    columns: Columns, num_robots: int
) -> tuple[Float[np.ndarray, "T N"], Float[np.ndarray, "T N 4"]]:
    """Return the heights and attitudes of robots with bodies."""
    height_m = []
    attitude = []
    for i in range(num_robots):
        path = body_of(i).path
        place_m = _numbers(columns[path, "Transform3D:translation"]).reshape(-1, 3)
        real_last = _numbers(columns[path, "Transform3D:quaternion"]).reshape(-1, 4)
        height_m.append(place_m[:, 2])
        attitude.append(real_last[:, [3, 0, 1, 2]])
    return np.stack(height_m, axis=1), np.stack(attitude, axis=1)


def _packets(
    columns: Columns,
    position_m: Float[np.ndarray, "T N 2"],
    height_m: Float[np.ndarray, "T N"] | None,
) -> dict[Fate, PacketPaths]:
    found: dict[Fate, PacketPaths] = {}
    for fate, style in palette.PACKETS.items():
        strips = columns.get((layers.PACKET_ARCS[fate].path, "LineStrips3D:strips"))
        if strips is None:  # addressed packets have other fates than broadcasts
            continue
        points_m = flattened(_numbers(strips).reshape(-1, SEGMENTS + 1, 3))
        row = _rows(strips)
        start_m = points_m[:, 0]  # the first point of each arc, and the last:
        # From the way that is drawn to the whole one.
        end_m = start_m + (points_m[:, -1] - start_m) / style.share
        if height_m is not None:
            start_m = _raised(start_m, row, position_m, height_m)
            end_m = _raised(end_m, row, position_m, height_m)
        found[fate] = PacketPaths(row=row, start_m=start_m, end_m=end_m)
    return found


def _raised(
    at_m: Float[np.ndarray, "L 2"],
    row: Int[np.ndarray, "L"],
    position_m: Float[np.ndarray, "T N 2"],
    height_m: Float[np.ndarray, "T N"],
) -> Float[np.ndarray, "L 3"]:
    """Return places on the map at the heights of the robots there; `row` is each one's window."""
    # What is drawn begins a little above the robots.
    up_m = np.zeros(len(at_m))
    for k in np.unique(row).tolist():
        first, after = np.searchsorted(row, [k, k + 1])
        apart_m = np.linalg.norm(at_m[first:after, None] - position_m[k], axis=2)
        up_m[first:after] = height_m[k, np.argmin(apart_m, axis=1)]
    return lifted(at_m, up_m)


def _mismatch(columns: Columns) -> LinkMismatch:
    window = NO_MISMATCH.window
    found = [NO_MISMATCH.links]
    for kind, layer in layers.SCENE_LINKS.items():
        for entity in (layer, of_others(layer)):
            if (entity.path, "margin_db") in columns:
                window = _windows(columns, entity)
                found.append(_links(columns, entity, kind))
    links = np.concatenate(found)
    return LinkMismatch(window=window, links=links[np.argsort(links["row"], kind="stable")])


def _links(columns: Columns, layer: Lines3D, kind: LinkKind) -> LinkRows:
    row = _rows(columns[layer.path, "sender"])
    links = np.zeros(len(row), LINK)
    links["row"] = row
    links["is_too_weak"] = kind == "too_weak"
    for name in NUMBERS:
        links[name] = _numbers(columns[layer.path, name])
    return links


def _rows(column: pa.Array) -> Int[np.ndarray, "L"]:
    # The window, from 0, of each thing in lists of things.
    per_window = np.diff(column.offsets.to_numpy())
    return np.repeat(np.arange(len(per_window)), per_window)


def _windows(columns: Columns, entity: Entity) -> Int[np.ndarray, "T"]:
    # An entity that was written in several parts has each window as often.
    windows = columns[entity.path, TIMELINE].to_numpy(zero_copy_only=False)
    return np.unique(windows).astype(int)


def _numbers(column: pa.Array) -> Float[np.ndarray, "K"]:
    while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        column = column.flatten()
    return column.to_numpy(zero_copy_only=False).astype(float)
