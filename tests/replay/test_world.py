"""What a world beyond free space adds, read back from the file, against the looks at it."""

import numpy as np
from reading import column, counts, rows, static
from rerun.chunk import RrdReader

from swarm_mj.physics.arenas import BLOCK_M


def test_lines_are_the_links_that_surprise(blocked, blocked_replay):
    looks, position_m = blocked.log.looks, blocked.log.position_m
    for kind, dashes in (("too_weak", 4), ("unbelieved", 1)):
        links = looks.surprises.by_kind[kind]
        start_m = position_m[looks.window[links.row] - 1, links.sender]
        for view, axes, pieces in (("arena", 2, dashes), ("scene", 3, 1)):
            entity, component = f"/{view}/world/{kind}", f"LineStrips{axes}D:strips"
            expected = pieces * np.bincount(links.row, minlength=len(looks.window))
            np.testing.assert_array_equal(counts(blocked_replay, entity, component), expected)
            strips = column(blocked_replay, entity, component).flatten().flatten().flatten()
            lines = strips.to_numpy().reshape(-1, 2, axes)[::pieces]
            np.testing.assert_allclose(lines[:, 0, :2], start_m, atol=1e-3)
            shown = column(blocked_replay, entity, "margin_db").flatten().to_numpy()
            np.testing.assert_array_equal(shown[::pieces], links.margin_db)


def test_the_map_has_the_blocks_of_the_city(blocked, blocked_replay):
    """14 robots have a side of 592 m: three blocks of 110 m by three."""
    strips = static(blocked_replay, "/arena/world/obstacle", "LineStrips2D:strips")
    outlines = np.array(strips.tolist()).reshape(9, 5, 2)
    np.testing.assert_allclose(np.ptp(outlines, axis=1), BLOCK_M, rtol=1e-5)
    assert np.abs(outlines).max() < blocked.mission.half_side_m


def test_who_points_at_an_obstacle_reads_its_loss(blocked_replay):
    entities = {chunk.entity_path for chunk in RrdReader(blocked_replay).stream()}
    blocks = {path for path in entities if path.startswith("/scene/area/geom")}
    assert len(blocks) == 9
    assert {float(static(blocked_replay, path, "loss_db")[0]) for path in blocks} == {25.0}


def test_halos_are_around_the_robots_that_are_cut_off(blocked, blocked_replay):
    log = blocked.log
    is_apart = np.array([[of != team[log.ego] for of in team] for team in log.group])
    assert 0 < np.sum(is_apart) < is_apart.size
    expected = log.position_m[is_apart]
    on_map = rows(blocked_replay, "/arena/world/cut_off", "Points2D:positions", 2)
    np.testing.assert_allclose(on_map, expected, rtol=1e-5, atol=1e-3)
    in_space = rows(blocked_replay, "/scene/world/cut_off", "Cylinders3D:centers", 3)
    np.testing.assert_allclose(in_space[:, :2], expected, rtol=1e-5, atol=1e-3)


def test_free_space_has_nothing_of_this(replay):
    assert not any("/world/" in chunk.entity_path for chunk in RrdReader(replay).stream())
