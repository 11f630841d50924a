"""The timelines, what lies over what on the map, and that every layer is drawn by some mission."""

from dataclasses import replace

import numpy as np
from reading import static
from rerun.chunk import RrdReader

from swarm_mj.replay.rerun_log import LAYERS
from swarm_mj.replay.write import write_replay

DRAWN = ("arena/", "tree/", "scene/grid", "scene/heading", "scene/packets", "scene/world")
OTHERS = {"scene/world/cut_off"}  # solids, whose width is in metres


def entities(path):
    """What a replay shows of the layers."""
    found = {chunk.entity_path.removeprefix("/") for chunk in RrdReader(path).stream()}
    return {name for name in found if name.startswith(DRAWN)} - OTHERS


def test_every_layer_is_drawn_by_some_mission_and_nothing_else(
    replay, flood_replay, blocked_replay, two_way, tmp_path
):
    unbounded = replace(two_way.mission, boundary="none")
    write_replay(two_way.log, unbounded, {"seed": 5}, tmp_path / "free.rrd")
    drawn = entities(replay) | entities(flood_replay) | entities(tmp_path / "free.rrd")
    assert not any("world" in name for name in drawn)
    drawn |= entities(blocked_replay)
    assert drawn == set(LAYERS)


def test_the_ground_lies_below_beliefs_these_below_packets_and_these_below_robots():
    order = {name: layer.order for name, layer in LAYERS.items()}
    ground = [
        order[name]
        for name in order
        if name.startswith(("arena/area", "arena/trail", "arena/world/filling", "arena/world/obs"))
    ]
    links = [order[name] for name in ("arena/world/unbelieved", "arena/world/too_weak")]
    beliefs = [order[name] for name in ("arena/belief/error", "arena/belief/ring", "arena/tree")]
    packets = [
        order[name]
        for name in order
        if name.startswith("arena/radio") and name != "arena/radio/range"
    ]
    assert max(ground) < min(links) <= max(links) < min(beliefs)
    assert min(beliefs) <= max(beliefs) < min(packets) < max(packets)
    assert order["arena/world/cut_off"] < order["arena/radio/transmitter"]
    assert max(packets) < order["arena/robots"] < order["arena/ego"]


def test_a_layer_s_look_is_kept_in_the_file(replay):
    entity = "/arena/radio/lost"
    layer = LAYERS["arena/radio/lost"]
    red, green, blue = layer.colour
    colour = static(replay, entity, "Arrows2D:colors")
    assert colour.tolist() == [(red << 24) + (green << 16) + (blue << 8) + 255]
    assert static(replay, entity, "Arrows2D:draw_order").tolist() == [layer.order]
    # rerun takes radii below 0 as points of the screen.
    assert float(static(replay, entity, "Arrows2D:radii")[0]) < 0.0


def test_the_clock_of_the_mission_runs_beside_the_windows(replay, two_way):
    (chunk,) = (
        chunk.to_record_batch()
        for chunk in RrdReader(replay).stream().filter(content="/arena/robots")
        if not chunk.is_static
    )
    nanoseconds = chunk.column("mission_time").to_numpy(zero_copy_only=False).astype(np.int64)
    np.testing.assert_allclose(nanoseconds / 1e9, 0.1 * two_way.log.window)
