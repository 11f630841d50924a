"""Columns of a flight, number by number against its windows."""

import numpy as np

import swarm_mj
from swarm_mj.api.flight_columns import flight_columns


def test_columns_are_the_windows_one_by_one():
    run = swarm_mj.fly("flocking", policy="mst", num_robots=4, num_windows=5, range_ratio=2.0)
    columns = flight_columns(run.mission, run.windows, run.log)
    assert columns["window"].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    np.testing.assert_allclose(columns["seconds"], run.mission.window_s * columns["window"])
    assert {len(column) for column in columns.values()} == {5}
    for row, window in enumerate(run.windows):
        assert columns["aoi"][row] == window.costs.age_windows[0]
        assert columns["hops"][row] == window.hops[0]
        assert columns["packets_delivered"][row] == window.costs.packets.delivered[0]
    np.testing.assert_array_equal(columns["aoi_worst"], run.log.age_max)
    assert "aoi_worst" not in flight_columns(run.mission, run.windows, None)
