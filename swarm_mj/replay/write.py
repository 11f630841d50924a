"""Writes a log as a rerun recording, its layout inside."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import rerun as rr
import rerun_bindings as bindings

from swarm_mj.mission import Mission
from swarm_mj.mission.components import components_in
from swarm_mj.physics.solid_geoms import obstacles_of
from swarm_mj.protocol.packets import BITS_PER_BYTE, bits_per_second
from swarm_mj.replay import arena, charts, palette
from swarm_mj.replay.digest import with_digest
from swarm_mj.replay.footage import facts_of
from swarm_mj.replay.frame import frame
from swarm_mj.replay.layout import layout
from swarm_mj.replay.legend import draw_legend
from swarm_mj.replay.links import Links, fates
from swarm_mj.replay.read import FACTS, check_replay
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.sheet import Sheet
from swarm_mj.replay.space import draw_space, stage
from swarm_mj.replay.world import draw_looks, draw_obstacles
from swarm_mj.system.atomic import write_bytes

APPLICATION = "swarm_mj"


def write_replay(log: Log, mission: Mission, config: dict[str, object], path: Path) -> None:
    """Write a replay; the file appears under its name only when it is whole.

    Args:
        log: What was flown.
        mission: Its numbers.
        config: Kept in the file as recording properties; values are numbers, texts or booleans.
        path: The file, replaced if it exists; missing folders are made.

    Raises:
        OSError: The file cannot be written.
    """
    # Rerun's own writer of files hides a full disk, or waits for space for good.
    recorded = with_digest(_recorded(log, mission, config, path.stem))
    bindings.flush_and_cleanup_orphaned_recordings()  # its threads, which would stay
    write_bytes(path, recorded, check=check_replay)


def _recorded(log: Log, mission: Mission, config: dict[str, object], name: str) -> bytes:
    """Return the bytes of a replay."""
    rr.set_strict_mode(True)  # bad data raises; otherwise a column is silently missing
    packets = fates(log)
    shown = frame(log.position_m, mission.half_side_m)
    with rr.RecordingStream(APPLICATION, send_properties=False) as recording:
        stream = recording.binary_stream()
        laid_out = layout(log, shown, packets)
        recording.send_blueprint(laid_out, make_active=False)
        laid_out.close()
        recording.set_log_tick_enabled(False)
        recording.set_log_time_enabled(False)
        recording.send_recording_name(name)
        recording.send_property("mission", rr.AnyValues(drop_untyped_nones=True, **config))
        policy, own = str(config.get("policy") or ""), components_in(config)
        facts = facts_of(log, mission, policy, _seed(config), own)
        recording.send_property(FACTS, rr.AnyValues(json=json.dumps(asdict(facts))))
        draw(Sheet(recording, log, shown, mission.window_s), mission, packets)
        said = config | _sent(log, mission, config)
        lines = [f"- **{key}**: {value}" for key, value in said.items()]
        about = "\n".join([f"# {name}", *lines])
        recording.log("about", rr.TextDocument(about, media_type="text/markdown"), static=True)
    return stream.read() or b""


def _sent(log: Log, mission: Mission, config: dict[str, object]) -> dict[str, object]:
    """What the team sent in a second, if it is known what a packet weighs."""
    packet_bytes = config.get("packet_bytes")
    if not isinstance(packet_bytes, int):
        return {}
    num_packets = np.sum(log.recipient != np.arange(log.recipient.shape[2]))
    bits = BITS_PER_BYTE * packet_bytes * num_packets
    return {"sent by the team": bits_per_second(bits / (len(log.window) * mission.window_s))}


def _seed(config: dict[str, object]) -> int:
    seed = config.get("seed", 0)
    return seed if isinstance(seed, int) else 0


def draw(sheet: Sheet, mission: Mission, packets: dict[str, Links]) -> None:
    """Draws every layer of a replay; `packets` by their fate."""
    log = sheet.log
    full_scale = palette.nice_scale(log.age)
    colours = palette.age_colours(log.ego_age, full_scale, log.is_known)
    colours[:, log.ego] = palette.EGO
    arena.draw_area(sheet, mission)
    arena.draw_robots(sheet, colours)
    if log.has_motion:
        arena.draw_beliefs(sheet)
    arena.draw_tree_on_map(sheet)
    arena.draw_radio(sheet, packets, mission.range_m)
    model = stage(sheet, mission)
    draw_space(sheet, model, packets, colours)
    draw_obstacles(sheet, obstacles_of(model))
    if log.looks is not None:
        draw_looks(sheet, log.looks)
    draw_legend(sheet, full_scale)
    charts.draw_tree(sheet, colours)
    charts.draw_age_matrix(sheet, full_scale)
    charts.draw_plots(sheet, packets)
    charts.draw_states(sheet)
