"""Reads a replay back: whether it is whole, which windows it holds, and what a video shows.

Rerun's format has no checksum of what it holds, so a replay ends in a digest: a second recording
stream that is empty but for a field that rerun passes over. It repeats the first stream's footer,
so that rerun finds it where it looks.
"""

import hashlib
import itertools
import shlex
from pathlib import Path

import numpy as np
import pyarrow as pa
from jaxtyping import Float, Int
from rerun.chunk import RrdReader

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Facts, Footage, shown_ground
from swarm_mj.replay.links import LINK, NO_MISMATCH, NUMBERS, SEGMENTS, LinkMismatch, PacketPaths
from swarm_mj.replay.rerun_log import TIMELINE
from swarm_mj.system.reading import open_file, read_json

FACTS = "footage"  # the recording's property that holds them
HEADER_BYTES = 12  # at the beginning of a stream
FOOTER_BYTES = 32  # at its end
FOOTER = b"RRF2FOOT\x01\x00\x00\x00"  # the end of the footer
END = (0).to_bytes(8, "little")  # the kind of a stream's last message
FIELD = b"\xfa\x7f\x20"  # protobuf's tag of field 2047, and the length of a SHA-256
SEAL_BYTES = HEADER_BYTES + len(END) + 8 + len(FIELD) + 32 + FOOTER_BYTES

Columns = dict[str, pa.Array]  # timed components, named "/entity component", one row per window


def with_digest(recorded: bytes) -> bytes:
    """Return a recording and its digest; raise OSError if rerun did not write its end."""
    if not recorded.endswith(FOOTER):
        raise OSError("rerun did not record the replay to its end")
    return recorded + _seal(memoryview(recorded))


def _seal(recorded: memoryview) -> bytes:
    field = FIELD + hashlib.sha256(recorded).digest()
    header, footer = recorded[:HEADER_BYTES], recorded[-FOOTER_BYTES:]
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
    return _windows(_columns(path), "/scene/robots")


def read_footage(path: Path) -> Footage:
    """Return what a video shows; raise as `check_replay`, for replays of earlier versions, too."""
    check_replay(path)
    try:
        chunks = RrdReader(path).stream().filter(content=f"/__properties/{FACTS}")
        (text,) = (chunk.to_record_batch().column("json")[0].as_py()[0] for chunk in chunks)
        facts = read_json(text, Facts)
        columns = _columns(path)
        mission = facts.mission
        age = _numbers(columns["/scene/robots age"]).reshape(-1, mission.num_robots)
        centres_m = _numbers(columns["/scene/robots Cylinders3D:centers"])
        position_m = centres_m.reshape(*age.shape, 3)[..., :2]
        # Teams at rest have no headings, and in free space no robot is cut off.
        none = pa.array(np.zeros(6 * age.size))
        headings = _numbers(columns.get("/scene/heading LineStrips3D:strips", none))
        start, end = np.moveaxis(headings.reshape(*age.shape, 2, 3), 2, 0)
        cut_off = _numbers(columns.get("/scene/robots is_cut_off", none[: age.size]))
        return Footage(
            facts=facts,
            window=_windows(columns, "/scene/robots"),
            position_m=position_m,
            velocity_mps=(end - start)[..., :2],
            known_age=age,
            is_cut_off=cut_off.reshape(age.shape) > 0.0,
            mismatch=_mismatch(columns),
            is_on=_numbers(columns["/scene/robots is_on"]).reshape(age.shape) > 0.0,
            packets=_packets(columns),
            age_mean=_numbers(columns["/plots/age/mean Measurements:values"]),
            ground=shown_ground(position_m, mission),
        )
    except (KeyError, ValueError, pa.ArrowException) as error:
        lack = "does not hold what a video shows, as replays of an earlier swarm-mj"
        raise ValueError(f"{path} {lack}; record it again") from error


def _columns(path: Path) -> Columns:
    # In one pass: each reader decodes the file anew.
    found: dict[str, list[pa.Table]] = {}
    shown = ["/scene/**", "/plots/age/mean"]
    for chunk in RrdReader(path).stream().filter(content=shown, is_static=False):
        table = pa.table(chunk.to_record_batch())
        for name in table.schema.names:
            column = table.select(list({TIMELINE, name}))
            found.setdefault(f"{chunk.entity_path} {name}", []).append(column)
    return {
        path: pa.concat_tables(tables).sort_by(TIMELINE).column(path.split()[-1]).combine_chunks()
        for path, tables in found.items()
    }


def _packets(columns: Columns) -> dict[str, PacketPaths]:
    found = {}
    for fate, style in palette.PACKETS.items():
        if (strips := columns.get(f"/scene/packets/{fate} LineStrips3D:strips")) is not None:
            points_m = _numbers(strips).reshape(-1, SEGMENTS + 1, 3)[..., :2]
            # From the way that is drawn to the whole one.
            start_m = points_m[:, 0]
            way_m = (points_m[:, -1] - start_m) / style.share
            found[fate] = PacketPaths(_rows(strips), start_m, start_m + way_m)
    return found


def _mismatch(columns: Columns) -> LinkMismatch:
    window, found = NO_MISMATCH.window, [NO_MISMATCH.links]
    for kind, whose in itertools.product(palette.MISMATCH, ("", "others/")):
        entity = f"/scene/world/{whose}{kind}"
        if f"{entity} margin_db" in columns:
            window = _windows(columns, entity)
            row = _rows(columns[f"{entity} sender"])
            links = np.zeros(len(row), LINK)
            links["row"], links["is_too_weak"] = row, kind == "too_weak"
            for name in NUMBERS:
                links[name] = _numbers(columns[f"{entity} {name}"])
            found.append(links)
    links = np.concatenate(found)
    return LinkMismatch(window, links[np.argsort(links["row"], kind="stable")])


def _rows(column: pa.Array) -> Int[np.ndarray, "L"]:
    # The window, from 0, of each thing in lists of things.
    per_window = np.diff(column.offsets.to_numpy())
    return np.repeat(np.arange(len(per_window)), per_window)


def _windows(columns: Columns, entity: str) -> Int[np.ndarray, "T"]:
    # An entity that was written in several parts has each window as often.
    return np.unique(columns[f"{entity} {TIMELINE}"].to_numpy(zero_copy_only=False)).astype(int)


def _numbers(column: pa.Array) -> Float[np.ndarray, "K"]:
    while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        column = column.flatten()
    return column.to_numpy(zero_copy_only=False).astype(float)
