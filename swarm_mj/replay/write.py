"""Writes a log as a rerun recording, its layout inside."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun_bindings as bindings

from swarm_mj.mission import Mission
from swarm_mj.mission.components import components_in
from swarm_mj.protocol.packets import BITS_PER_BYTE, bits_per_second
from swarm_mj.replay import charts, palette
from swarm_mj.replay.footage import Footage, footage_of, frame
from swarm_mj.replay.layout import draw_legend, layout
from swarm_mj.replay.links import is_other
from swarm_mj.replay.read import FACTS, with_digest
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.stage import draw_stage
from swarm_mj.replay.team import draw_team
from swarm_mj.system.writing import write_bytes

APPLICATION = "swarm_mj"


def write_replay(log: Log, mission: Mission, config: Mapping[str, Any], path: Path) -> None:
    """Write or replace a replay, which appears under its name only when it is whole.

    `config` is kept in the file as recording properties: numbers, texts or booleans. Missing
    folders are made. Raise OSError if the file cannot be written.
    """
    # Rerun's own writer of files hides a full disk, or waits for space for good.
    recorded = with_digest(_recorded(log, mission, config, path.stem))
    bindings.flush_and_cleanup_orphaned_recordings()  # its threads, which would stay
    write_bytes(path, recorded)


def _recorded(log: Log, mission: Mission, config: Mapping[str, Any], name: str) -> bytes:
    rr.set_strict_mode(True)  # bad data raises; otherwise a column is silently missing
    policy, seed = config.get("policy") or "", config.get("seed", 0)
    footage = footage_of(log, mission, policy, seed, components_in(config))
    shown, plotted = frame(log.position_m, mission.half_side_m), charts.plots(log)
    with rr.RecordingStream(APPLICATION, send_properties=False) as recording:
        stream = recording.binary_stream()
        laid_out = layout(log, shown, plotted)
        recording.send_blueprint(laid_out, make_active=False)
        laid_out.close()
        recording.set_log_tick_enabled(False)
        recording.set_log_time_enabled(False)
        recording.send_recording_name(name)
        recording.send_property("mission", rr.AnyValues(drop_untyped_nones=True, **config))
        recording.send_property(FACTS, rr.AnyValues(json=json.dumps(asdict(footage.facts))))
        out = RerunLog(recording, log, shown, mission.window_s)
        draw(out, footage)
        charts.draw_plots(out, plotted)
        said = dict(config)
        if config.get("packet_bytes") is not None:
            bits = BITS_PER_BYTE * config["packet_bytes"] * np.sum(is_other(log.recipient))
            rate = bits / (len(log.window) * mission.window_s)
            said["sent by the team"] = bits_per_second(rate)
        about = "\n".join([f"# {name}", *(f"- **{key}**: {value}" for key, value in said.items())])
        out.fixed("about", rr.TextDocument(about, media_type="text/markdown"))
    return stream.read() or b""


def draw(out: RerunLog, footage: Footage) -> None:
    """Draw every layer of a replay but the plots."""
    log, full_scale = out.log, footage.facts.full_scale
    colours, known = (  # the tree also shows robots that are off
        palette.robot_colours(log.known_age, full_scale, is_on, log.ego)
        for is_on in (log.is_on, np.ones_like(log.is_on))
    )
    # First, for rerun takes the type of "loss_db" from its first use, and obstacles' is no integer.
    draw_stage(out, footage.facts.mission)
    draw_team(out, footage, colours)
    draw_legend(out, full_scale)
    charts.draw_tree(out, known)
    charts.draw_age_matrix(out, full_scale)
    charts.draw_states(out)
