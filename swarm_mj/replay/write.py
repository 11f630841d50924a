"""Writes a log as a rerun recording: what moves on the map and in 3-D, and all else around it."""

import json
import re
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun_bindings as bindings

from swarm_mj.protocol.packets import BITS_PER_BYTE
from swarm_mj.radio.words import bits_per_second
from swarm_mj.replay import charts, layers, palette, plots
from swarm_mj.replay.bodies import draw_bodies
from swarm_mj.replay.layer_kinds import Lines, Lines3D, of_others
from swarm_mj.replay.layout import draw_legend, layout
from swarm_mj.replay.links import (
    PIECES,
    LinkRows,
    arcs,
    by_kind,
    divided,
    ends,
    is_other,
    lifted,
    on_map,
)
from swarm_mj.replay.log import LEAD_WINDOWS, Log
from swarm_mj.replay.palette import LinkKind
from swarm_mj.replay.read import FACTS, with_digest
from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.stage import draw_stage, move_ground
from swarm_mj.replay.training_curve import TrainingCurve
from swarm_mj.system.writing import write_bytes

TRAIL_STRIDE = 15
TRAIL_EVERY = 5  # windows; in between, the last one is shown
HEADING_SHARE = 0.06  # a heading's length, of half the map's width
RING_SHARE = 0.014  # the radius of a ring around a believed position, likewise
WIND_SHARE = 0.15  # the length of the arrow of a strong wind, likewise
WIND_PLACE = 0.9  # where it begins, from the middle to the corner in the north-west
STRONG_GUST = 2.0  # standard deviations of a gust, on top of the mean
ASIDE_SHARE = 0.8 * RING_SHARE  # from a request to its answer, likewise
RADIUS_SHARE = 1.4 * RING_SHARE  # of a body in 3-D, likewise
ON_BODY = 0.5  # of a disc's width, where it is on a body that it must not hide
OBSERVER = 1.3  # times larger
BODY_HEIGHT = 0.8  # of a body, by its radius
HALO_M = 2.0  # height of what surrounds a robot that is cut off


def write_replay(log: Log, config: Mapping[str, Any], path: Path) -> None:
    """Write a replay, whole or not at all, with `config` as its properties; or raise OSError."""
    # Rerun's own writer of files hides a full disk, or waits for space for good.
    recorded = with_digest(_recorded(log, config, path.stem))
    bindings.flush_and_cleanup_orphaned_recordings()  # its threads, which would stay
    write_bytes(path, recorded)


def _recorded(log: Log, config: Mapping[str, Any], name: str) -> bytes:
    with new_recording(log) as recording:
        stream = recording.binary_stream()
        send_properties(recording, log, config, name)
        out = RerunLog([recording], log)
        # First: rerun takes the type of "loss_db" from its first use, and obstacles' is no integer.
        draw_stage(out)
        draw_piece(out)
        draw_whole(out, config, name)
        plots.draw_agreement(out)
        send_layout(recording, out)
    return stream.read() or b""


def new_recording(log: Log, curve: TrainingCurve | None = None) -> rr.RecordingStream:
    """Return a recording of this kind of flight, or training, which goes nowhere yet."""
    rr.set_strict_mode(True)  # bad data raises; otherwise a column is silently missing
    application = _application(log) if curve is None else f"training - {_application(log)}"
    recording = rr.RecordingStream(application, send_properties=False)
    recording.set_log_tick_enabled(False)
    recording.set_log_time_enabled(False)
    return recording


def send_properties(
    recording: rr.RecordingStream, log: Log, config: Mapping[str, Any], name: str
) -> None:
    """Send what the recording is of."""
    recording.send_recording_name(name)
    recording.send_property("mission", rr.AnyValues(drop_untyped_nones=True, **config))
    recording.send_property(FACTS, rr.AnyValues(json=json.dumps(asdict(log.facts))))


def draw_piece(out: RerunLog) -> None:
    """Draw all that changes, of a flight or of a piece of it."""
    draw_team(out)
    charts.draw_tree(out)
    charts.draw_age_matrix(out)
    charts.draw_states(out)
    plots.draw_plots(out)
    out.drawn.num_windows += len(out.log.window)
    out.drawn.num_sent += int(np.sum(is_other(out.log.recipient)))


def draw_growing(out: RerunLog) -> None:
    """Draw what grows with every piece and shows all windows so far."""
    charts.draw_tree_hops(out)
    charts.draw_all_states(out)


def draw_whole(out: RerunLog, config: Mapping[str, Any], name: str) -> None:
    """Draw what never changes and depends on all windows of the flight."""
    draw_legend(out)
    draw_growing(out)
    about = "\n".join([f"# {name}", *_about(out, config)])
    out.fixed(layers.ABOUT, rr.TextDocument(about, media_type="text/markdown"))


def send_layout(
    recording: rr.RecordingStream,
    out: RerunLog,
    *,
    is_live: bool = False,
    live_fps: float | None = None,
    curve: TrainingCurve | None = None,
) -> None:
    """Send the layout, as of `layout`; without one, rerun makes its own."""
    try:
        laid_out = layout(out, is_live=is_live, live_fps=live_fps, curve=curve)
    except (AttributeError, TypeError) as error:  # rerun calls its views unstable
        lack = f"rerun-sdk {rr.__version__} does not know a part of the layout ({error})"
        warnings.warn(f"{lack}, so the replay has rerun's own", stacklevel=2)
        return
    # Active, for rerun's page in a browser ignores one that is a default only.
    recording.send_blueprint(laid_out, make_active=True)
    laid_out.close()


def _application(log: Log) -> str:
    """Return the name of a kind of replay: rerun gives all of one name the layout of the last."""
    mission = log.facts.mission
    packets = "broadcasts" if log.facts.is_broadcast else "addressed packets"
    parts = [mission.task, f"{mission.num_robots} robots", f"{mission.side_m:.0f} m", packets]
    if log.is_compared:
        parts.append("beyond free space")
    if log.task_cost is not None:
        parts.append(log.task_cost.name)
    parts.append(f"seen by r{log.ego}")
    parts.append("swarm_mj")
    name = " - ".join(parts)
    return re.sub(r"[^a-zA-Z0-9 _-]", "-", name)  # rerun warns of other characters


def _about(out: RerunLog, config: Mapping[str, Any]) -> Iterator[str]:
    for key, value in config.items():
        yield f"- **{key}**: {value}"
    if config.get("packet_bytes") is not None:
        bits = BITS_PER_BYTE * config["packet_bytes"] * out.drawn.num_sent
        rate = bits / (out.drawn.num_windows * out.log.facts.mission.window_s)
        yield f"- **sent by the team**: {bits_per_second(rate)}"
    since = plots.agreed(out)
    if since is not None:
        yield f"- **the flock has agreed**: from window {since} on"


def draw_team(out: RerunLog) -> None:
    """Draw everything that moves, the same on the map and in 3-D."""
    log = out.log
    if not log.facts.mission.has_walls:
        move_ground(out)
    radius_m = RADIUS_SHARE * out.unit_m
    height_m = BODY_HEIGHT * radius_m
    _draw_robots(out)
    _draw_discs(out, radius_m, height_m)
    if log.attitude is not None:
        draw_bodies(out, radius_m)
    _draw_wind(out)
    if log.has_motion:
        _draw_motion(out, height_m)
        _draw_trails(out)
        _draw_beliefs(out)
    row, child = np.nonzero(log.has_parent)
    parent = log.parent[row, child]
    out.lines(layers.PARENTS, log.position_m[row, parent], log.position_m[row, child], row)
    _draw_radio(out)
    keep_packets(out)
    _draw_packets(out)
    for fate, packets in log.packets.items():
        strips = arcs(packets, height_m, palette.PACKETS[fate].share)
        out.strips(layers.PACKET_ARCS[fate], strips, packets.row)
    if log.is_compared:
        _draw_mismatch(out, height_m)
        _draw_cut_off(out, radius_m)
        out.drawn.is_any_cut_off |= bool(np.any(log.is_cut_off))
        for kind, found in by_kind(log.mismatch.links).items():
            if len(found) > 0:
                out.drawn.link_kinds.add(kind)


def _draw_robots(out: RerunLog) -> None:
    log = out.log
    names = [f"r{i}" for i in range(log.parent.shape[1])]
    out.look(layers.ROBOTS, rr.Points2D.from_fields(labels=names, show_labels=False))
    where_m = log.position_m.reshape(-1, 2)
    out.points(layers.ROBOTS, where_m, colours=log.colours.reshape(-1, 3))
    row = np.arange(len(log.window))
    where_m = log.position_m[:, log.ego]
    radius_m = 2.0 * RING_SHARE * out.unit_m
    out.rings(layers.EGO, where_m, radius_m, row)
    # The name is a point's label, for rerun misplaces an ellipse's.
    name = rr.Points2D.from_fields(labels=[f"r{log.ego}"], show_labels=True)
    out.look(layers.EGO_NAME, name)
    out.points(layers.EGO_NAME, where_m - (0.0, 3.0 * radius_m), row)


def _draw_discs(out: RerunLog, radius_m: float, height_m: float) -> None:
    log = out.log
    entity = layers.SCENE_ROBOTS
    share = 1.0 if log.attitude is None else ON_BODY
    radii = np.full(log.is_on.shape[1], share * radius_m)
    radii[log.ego] *= OBSERVER
    lengths = np.full(len(radii), height_m)
    out.look(entity, rr.Cylinders3D.from_fields(radii=radii, lengths=lengths, fill_mode="solid"))
    where_m = lifted(log.position_m, log.above(height_m / 2.0)).reshape(-1, 3)
    colours = log.colours.reshape(-1, 3)
    out.things(entity, rr.Cylinders3D.columns(centers=where_m, colors=colours))
    # Those who click on one, and videos, read what is known of it.
    age = log.known_age.astype(np.float32).ravel()
    out.things(entity, rr.AnyValues.columns(age=age, is_on=log.is_on.ravel()))
    if log.is_compared:
        out.things(entity, rr.AnyValues.columns(is_cut_off=log.is_cut_off.ravel()))


def _draw_motion(out: RerunLog, height_m: float) -> None:
    log = out.log
    speed = np.linalg.norm(log.velocity_mps, axis=2, keepdims=True)
    # All of one length, for agreement is in directions.
    length_m = HEADING_SHARE * out.unit_m * out.scale
    way_m = length_m * log.velocity_mps / np.maximum(speed, 1e-9)
    start_m = log.position_m
    end_m = log.position_m + way_m
    out.lines(layers.HEADINGS, start_m.reshape(-1, 2), end_m.reshape(-1, 2))
    above_m = log.above(height_m)
    raised_m = [lifted(end, above_m).reshape(-1, 3) for end in (start_m, end_m)]
    out.lines(layers.SCENE_HEADINGS, *raised_m)


def _draw_wind(out: RerunLog) -> None:
    """Draw the wind of each window, if any blows, as an arrow in a corner; on the floor in 3-D."""
    wind_mps = out.log.wind_mps
    if wind_mps is None:
        return
    mission = out.log.facts.mission
    strong_mps = mission.wind_mps + STRONG_GUST * mission.gust_mps
    vectors_m = WIND_SHARE * out.unit_m * wind_mps / strong_mps
    start_m = out.log.ground.centre_m + WIND_PLACE * np.array([-out.unit_m, out.unit_m])
    row = np.arange(len(vectors_m))
    out.arrows(layers.WIND, start_m, vectors_m, row)
    end_m = start_m + vectors_m
    out.lines(layers.SCENE_WIND, lifted(start_m, 0.0), lifted(end_m, 0.0), row)


def _draw_trails(out: RerunLog) -> None:
    log = out.log
    # Trails are drawn anew every few windows only: they would be half the file.
    rows = np.flatnonzero((log.window - 1) % TRAIL_EVERY == 0)
    way_m = np.concatenate([log.lead.position_m, log.position_m])
    at = len(log.lead.position_m) + rows
    past = range(0, LEAD_WINDOWS + 1, TRAIL_STRIDE)
    trail_m = np.stack([way_m[np.maximum(0, at - ago)] for ago in past], axis=2)
    num_robots = trail_m.shape[1]
    out.look(layers.TRAILS, layers.TRAILS.look())
    columns = rr.LineStrips2D.columns(strips=trail_m.reshape(-1, len(past), 2))
    out.timed(layers.TRAILS, columns.partition([num_robots] * len(rows)), log.window[rows])


def _draw_beliefs(out: RerunLog) -> None:
    log = out.log
    row, other = np.nonzero(log.is_other_known)
    believed_m = log.believed_m[row, other]
    out.lines(layers.BELIEF_ERROR, believed_m, log.position_m[row, other], row)
    out.rings(layers.BELIEF, believed_m, RING_SHARE * out.unit_m, row)


def _draw_radio(out: RerunLog) -> None:
    log = out.log
    row, sender = np.nonzero(log.is_transmitter)
    where_m = log.position_m[row, sender]
    out.rings(layers.RANGE, where_m, log.facts.mission.range_m, row)
    if log.facts.is_broadcast:
        out.points(layers.TRANSMITTERS, where_m, row)


def _draw_packets(out: RerunLog) -> None:
    log = out.log
    if not log.facts.is_broadcast:
        lost = log.packets["lost"]
        out.lines(layers.LOST_REST, on_map(lost.start_m), on_map(lost.end_m), lost.row)
    for fate, packets in log.packets.items():
        start_m = on_map(packets.start_m)
        end_m = on_map(packets.end_m)
        if fate in layers.PACKET_LINES:
            line = layers.PACKET_LINES[fate]
            out.lines(line, start_m, end_m, packets.row)
            continue
        way_m = end_m - start_m
        origins_m = start_m
        if fate in ("answered", "unanswered"):  # an answer stands beside its request, to the left
            length_m = np.maximum(np.linalg.norm(way_m, axis=1, keepdims=True), 1e-6)
            aside_m = ASIDE_SHARE * out.unit_m
            origins_m = origins_m + aside_m * (way_m[:, ::-1] * (-1.0, 1.0) / length_m)
        vectors_m = palette.PACKETS[fate].share * way_m
        out.arrows(layers.PACKET_ARROWS[fate], origins_m, vectors_m, packets.row)


def keep_packets(out: RerunLog) -> None:
    """Write whom each robot addressed and decoded in both slots of each window, for exports."""
    log = out.log
    # As recorded, and not packet by packet: most robots are silent and hear nobody, which
    # compresses well. Robots have numbers below 10,000.
    columns = rr.AnyValues.columns(
        recipient=log.recipient.astype(np.int16).ravel(), heard=log.heard.astype(np.int16).ravel()
    )
    per_window = np.full(len(log.window), log.recipient[0].size)
    out.timed(layers.PACKETS, columns.partition(per_window))


def _draw_mismatch(out: RerunLog, height_m: float) -> None:
    links = out.log.mismatch.links
    is_own = out.log.is_own(links)
    for kind, those in by_kind(links[is_own]).items():
        _draw_links(out, kind, those, layers.LINKS[kind], layers.SCENE_LINKS[kind], height_m)
    for kind, those in by_kind(links[~is_own]).items():
        flat = of_others(layers.LINKS[kind])
        in_scene = of_others(layers.SCENE_LINKS[kind])
        _draw_links(out, kind, those, flat, in_scene, height_m)


def _draw_links(
    out: RerunLog,
    kind: LinkKind,
    links: LinkRows,
    flat: Lines,
    in_scene: Lines3D,
    height_m: float,
) -> None:
    log = out.log
    at = log.mismatch.window[links["row"]] - log.window[0]
    whole_m = ends(links, log.position_m, at)
    # In 3-D they are whole, whatever their kind: dashes would make the file larger.
    above_m: float | np.ndarray = height_m
    if log.height_m is not None:
        both = np.stack([links["sender"], links["receiver"]], axis=1)
        above_m = height_m + log.height_m[at[:, None], both]
    out.mismatch_lines(in_scene, kind, links, lifted(whole_m, above_m))
    pieces = PIECES[kind]
    each = np.repeat(links, len(pieces))
    out.mismatch_lines(flat, kind, each, divided(whole_m, pieces))


def _draw_cut_off(out: RerunLog, radius_m: float) -> None:
    log = out.log
    row, robot = np.nonzero(log.is_cut_off)
    where_m = log.position_m[row, robot]
    out.points(layers.CUT_OFF, where_m, row)
    entity = layers.SCENE_CUT_OFF
    out.look(entity, rr.Cylinders3D.from_fields(colors=[palette.CUT_OFF], fill_mode="solid"))
    radii = np.full(len(row), palette.HALO * radius_m)
    lengths = np.full(len(row), HALO_M)
    halos = rr.Cylinders3D.columns(centers=lifted(where_m, 0.0), radii=radii, lengths=lengths)
    out.things(entity, halos, row)
