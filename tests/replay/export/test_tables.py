"""The tables of an export, read back as spreadsheets read them."""

import csv
import math

import numpy as np
import pytest

from swarm_mj.replay.export.tables import ages_table, packets_table, positions_table
from swarm_mj.replay.read import read_flown
from swarm_mj.replay.write import write_replay


def rows_of(content):
    return list(csv.DictReader(content.decode().splitlines()))


def test_positions_have_a_row_for_each_window_and_robot(requests, two_way, nothing):
    rows = rows_of(positions_table(requests, nothing))
    log = two_way.log
    num_windows, num_robots = log.is_on.shape
    assert len(rows) == num_windows * num_robots
    for row in rows:
        k, robot = int(row["window"]) - 1, int(row["robot"])
        assert float(row["seconds"]) == pytest.approx(0.1 * k)
        place_m = [float(row["x_m"]), float(row["y_m"])]
        np.testing.assert_allclose(place_m, log.position_m[k, robot], atol=1e-4)
        assert (row["vx_mps"] == "") == (k == 0)
        assert row["is_on"] == "1"
    place = rows[2 * num_robots + 3]
    before = rows[num_robots + 3]
    way_m = float(place["x_m"]) - float(before["x_m"])
    assert float(place["vx_mps"]) == pytest.approx(way_m / 0.1, abs=1e-4)
    assert "(" not in positions_table(requests, nothing).decode()  # no types of NumPy's


def test_points_have_the_columns_that_they_always_had(requests, nothing):
    header, *_ = positions_table(requests, nothing).decode().splitlines()
    assert header == "window,seconds,robot,x_m,y_m,vx_mps,vy_mps,is_on"


def test_bodies_have_their_heights_in_the_last_columns(climbing, nothing):
    """They climb 0.2 m in each window of 0.1 s."""
    content = positions_table(climbing, nothing)
    header, *_ = content.decode().splitlines()
    assert header == "window,seconds,robot,x_m,y_m,vx_mps,vy_mps,is_on,z_m,vz_mps"
    rows = rows_of(content)
    start_m = [float(row["z_m"]) for row in rows[:12]]
    assert max(start_m) > 30.0
    for row in rows:
        k, robot = int(row["window"]) - 1, int(row["robot"])
        assert float(row["z_m"]) == pytest.approx(start_m[robot] + 0.2 * k, abs=1e-5)
        if k == 0:
            assert row["vz_mps"] == ""
        else:
            assert float(row["vz_mps"]) == pytest.approx(2.0, abs=1e-6)


def test_robots_that_failed_are_off(failing, tmp_path, nothing):
    write_replay(failing.log, {"seed": 5}, tmp_path / "a.rrd")
    rows = rows_of(positions_table(read_flown(tmp_path / "a.rrd"), nothing))
    is_on = np.array([row["is_on"] == "1" for row in rows]).reshape(failing.log.is_on.shape)
    np.testing.assert_array_equal(is_on, failing.log.is_on)
    assert not np.all(is_on)


def test_packets_have_slot_and_fate_and_those_who_decoded_them(requests, two_way, nothing):
    rows = rows_of(packets_table(requests, nothing))
    log = two_way.log
    recipient = np.tile(np.arange(12), (30, 2, 1))
    heard = recipient.copy()
    for row in rows:
        k, slot, sender = int(row["window"]) - 1, int(row["slot"]), int(row["sender"])
        assert float(row["seconds"]) == pytest.approx(0.1 * k + 0.05 * slot)
        recipient[k, slot, sender] = int(row["recipient"])
        receivers = list(map(int, row["receivers"].split()))
        assert int(row["num_receivers"]) == len(receivers)
        heard[k, slot, receivers] = sender
        is_decoded = int(row["recipient"]) in receivers
        assert (row["fate"] in ("delivered", "answered")) == is_decoded
    np.testing.assert_array_equal(recipient, log.recipient)
    np.testing.assert_array_equal(heard, log.heard)


def test_broadcasts_have_no_recipient(broadcasts, nothing):
    rows = rows_of(packets_table(broadcasts, nothing))
    assert {row["recipient"] for row in rows} == {""}
    assert {row["fate"] for row in rows} == {"heard", "unheard"}


def test_ages_have_a_row_for_each_window_and_a_column_for_each_robot(requests, two_way, nothing):
    rows = rows_of(ages_table(requests, nothing))
    log = two_way.log
    assert len(rows) == len(log.window)
    for k, row in enumerate(rows):
        assert float(row["seconds"]) == pytest.approx(0.1 * (k + 1))
        assert float(row["aoi"]) == pytest.approx(log.age_mean[k], abs=1e-6)
        assert float(row["aoi_std"]) == pytest.approx(log.age_std[k], abs=1e-6)
        assert float(row["aoi_worst"]) == pytest.approx(log.age_max[k], abs=1e-6)
        assert row["observer"] == "4"
        known = [math.nan if (cell := row[f"r{i}"]) == "" else float(cell) for i in range(12)]
        np.testing.assert_allclose(known, log.known_age[k], atol=1e-6)


@pytest.mark.parametrize("table", [positions_table, packets_table, ages_table])
def test_each_window_is_counted(requests, table):
    done = []
    table(requests, lambda: done.append(1))
    assert len(done) == 30
