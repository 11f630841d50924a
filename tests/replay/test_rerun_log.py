"""The timelines, what lies over what on the map, and that every layer is drawn by some mission."""

from dataclasses import replace

import numpy as np
from reading import column, entities, static

from swarm_mj.replay.palette import MISMATCH
from swarm_mj.replay.rerun_log import LAYERS
from swarm_mj.replay.write import write_replay

DRAWN = (
    "/arena/",
    "/tree/",
    "/state/now",
    "/scene/grid",
    "/scene/heading",
    "/scene/packets",
    "/scene/world",
)
OTHERS = {"scene/world/cut_off"}  # solids, whose width is in metres


def test_every_layer_is_drawn_by_some_mission_and_nothing_else(
    replay, flood_replay, blocked_replay, two_way, tmp_path
):
    log, facts = two_way.log, two_way.log.facts
    facts = replace(facts, mission=replace(facts.mission, boundary="none"))
    write_replay(replace(log, facts=facts), {"seed": 5}, tmp_path / "free.rrd")
    paths = (replay, flood_replay, blocked_replay, tmp_path / "free.rrd")
    found = {entity for path in paths for entity in entities(path) if entity.startswith(DRAWN)}
    links = {f"/{view}/world/others/{kind}" for view in ("arena", "scene") for kind in MISMATCH}
    assert links <= found  # drawn as the observer's
    assert {entity.removeprefix("/") for entity in found - links} - OTHERS == set(LAYERS)


def test_the_ground_lies_below_beliefs_these_below_packets_and_these_below_robots():
    def orders(*beginnings):
        names = [name for name in LAYERS if name.startswith(beginnings)]
        return [LAYERS[name].order for name in names if name != "arena/radio/range"]

    ground = orders("arena/area", "arena/trail", "arena/world/filling", "arena/world/obs")
    links = orders("arena/world/unbelieved", "arena/world/too_weak")
    beliefs, packets = orders("arena/belief", "arena/tree"), orders("arena/radio")
    for below, above in ((ground, links), (links, beliefs), (beliefs, packets)):
        assert max(below) < min(above)
    assert LAYERS["arena/world/cut_off"].order < LAYERS["arena/radio/transmitter"].order
    assert max(packets) < LAYERS["arena/robots"].order < LAYERS["arena/ego"].order


def test_a_layer_s_look_is_kept_in_the_file(replay):
    layer, entity = LAYERS["arena/radio/lost"], "/arena/radio/lost"
    red, green, blue = layer.colour
    colour = static(replay, entity, "Arrows2D:colors")
    assert colour.tolist() == [(red << 24) + (green << 16) + (blue << 8) + 255]
    assert static(replay, entity, "Arrows2D:draw_order").tolist() == [layer.order]
    # rerun takes radii below 0 as points of the screen.
    assert float(static(replay, entity, "Arrows2D:radii")[0]) < 0.0


def test_the_clock_of_the_mission_runs_beside_the_windows(replay, two_way):
    times = column(replay, "/plots/age/ego", "mission_time").to_numpy(zero_copy_only=False)
    np.testing.assert_allclose(times.astype(np.int64) / 1e9, 0.1 * two_way.log.window)
    windows = column(replay, "/plots/age/ego", "window").to_numpy()
    np.testing.assert_array_equal(windows, two_way.log.window)
