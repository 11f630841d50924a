"""A layer's look in the file, and the timelines."""

import numpy as np
from reading import column, static

from swarm_mj.replay import layers


def test_a_layer_s_look_is_kept_in_the_file(replay):
    entity = f"/{layers.LOST.path}"
    red, green, blue = layers.LOST.colour
    colour = static(replay, entity, "Arrows2D:colors")
    assert colour.tolist() == [(red << 24) + (green << 16) + (blue << 8) + 255]
    assert static(replay, entity, "Arrows2D:draw_order").tolist() == [layers.LOST.order]
    # rerun takes radii below 0 as points of the screen.
    radius = float(static(replay, entity, "Arrows2D:radii")[0])
    np.testing.assert_allclose(radius, -layers.LOST.width, rtol=1e-6)


def test_the_clock_of_the_mission_runs_beside_the_windows(replay, two_way):
    times = column(replay, "/plots/age/ego", "mission_time").to_numpy(zero_copy_only=False)
    np.testing.assert_allclose(times.astype(np.int64) / 1e9, 0.1 * two_way.log.window)
    windows = column(replay, "/plots/age/ego", "window").to_numpy()
    np.testing.assert_array_equal(windows, two_way.log.window)
