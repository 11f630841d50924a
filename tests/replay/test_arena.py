"""The replay's map, read back from the file, against the flight it shows."""

from dataclasses import replace

import numpy as np
import pytest
from reading import column, counts, rows, rows_of_strips, static

from swarm_mj.replay import palette
from swarm_mj.replay.arena import square_m
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.write import write_replay


def test_positions_are_the_simulation_s(replay, two_way):
    shown = rows(replay, "/arena/robots", "Points2D:positions", 12, 2)
    np.testing.assert_allclose(shown, two_way.log.position_m, rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("fate", ["delivered", "lost", "answered"])
def test_arrows_are_as_many_as_the_packets_counted(replay, two_way, fate):
    shown = counts(replay, f"/arena/radio/{fate}", "Arrows2D:vectors")
    np.testing.assert_array_equal(shown, two_way.counted(fate))


def test_a_delivered_packet_s_arrow_ends_at_its_receiver(replay, two_way):
    links = two_way.log.packets["delivered"]
    entity = "/arena/radio/delivered"
    start = rows(replay, entity, "Arrows2D:origins", 2)
    way = rows(replay, entity, "Arrows2D:vectors", 2)
    receiver = two_way.log.position_m[links.row, links.receiver]
    np.testing.assert_allclose(start + way, receiver, rtol=1e-5, atol=1e-2)


def test_a_lost_packet_s_arrow_stops_short(replay, two_way):
    links = two_way.log.packets["lost"]
    start = two_way.log.position_m[links.row, links.sender]
    full = two_way.log.position_m[links.row, links.receiver] - start
    way = rows(replay, "/arena/radio/lost", "Arrows2D:vectors", 2)
    np.testing.assert_allclose(way, 0.6 * full, rtol=1e-5, atol=1e-2)


def test_rings_are_where_the_observer_believes_the_others(replay, two_way):
    log = two_way.log
    shown = log.is_known & (np.arange(12) != log.ego)
    entity = "/arena/belief/ring"
    np.testing.assert_array_equal(
        counts(replay, entity, "Ellipses2D:centers"), np.sum(shown, axis=1)
    )
    centres = rows(replay, entity, "Ellipses2D:centers", 2)
    np.testing.assert_allclose(centres, log.believed_m[shown], rtol=1e-6, atol=1e-4)


def test_north_is_up(replay):
    np.testing.assert_array_equal(
        static(replay, "/arena", "Transform3D:mat3x3"), [1, 0, 0, 0, -1, 0, 0, 0, 1]
    )


def test_a_map_that_follows_the_team_keeps_it_in_the_middle(two_way, tmp_path):
    """North stays up: what is shown of p is p - c with y turned round."""
    drift = np.linspace(0.0, 9e3, 30)[:, None, None] * np.array([1.0, 0.5])
    log = replace(two_way.log, position_m=two_way.log.position_m + drift)
    write_replay(log, two_way.mission, {"seed": 5}, tmp_path / "far.rrd")
    matrix = rows(tmp_path / "far.rrd", "/arena", "Transform3D:mat3x3", 9)
    np.testing.assert_array_equal(matrix, [[1, 0, 0, 0, -1, 0, 0, 0, 1]] * 30)
    shift = rows(tmp_path / "far.rrd", "/arena", "Transform3D:translation", 3)[:, None, :2]
    shown = log.position_m * (1.0, -1.0) + shift
    middle = (shown.min(axis=1) + shown.max(axis=1)) / 2.0
    np.testing.assert_allclose(middle, 0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("reach_m", "way_m", "square"), [(500.0, 0.0, 100.0), (500.0, 4e3, 100.0), (500.0, 9e3, 1e3)]
)
def test_squares_are_few_enough_to_be_seen(reach_m, way_m, square):
    centre_m = np.array([[0.0, 0.0], [way_m, 0.0]])
    assert square_m(Ground(centre_m=centre_m, reach_m=reach_m)) == square


def test_headings_have_one_length_and_the_direction_of_flight(replay, two_way):
    strips = rows_of_strips(replay, "/arena/heading")
    way = strips[:, 1] - strips[:, 0]
    length = np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(length, length[0], rtol=1e-2)
    velocity = two_way.log.velocity_mps.reshape(-1, 2)
    along = np.sum(way * velocity, axis=1) / length / np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(along, 1.0, atol=1e-3)


def test_lines_lead_from_transmitters_to_hearers(flood_replay, flooded):
    log, links = flooded.log, flooded.log.packets["heard"]
    strips = rows_of_strips(flood_replay, "/arena/radio/heard")
    expected = np.stack(
        [log.position_m[links.row, links.sender], log.position_m[links.row, links.receiver]], axis=1
    )
    np.testing.assert_allclose(strips, expected, rtol=1e-5, atol=1e-3)


def test_every_transmitter_of_a_broadcast_is_marked(flood_replay, flooded):
    log = flooded.log
    row, sender = np.nonzero(np.any(log.recipient != np.arange(12), axis=1))
    marked = rows(flood_replay, "/arena/radio/transmitter", "Points2D:positions", 2)
    np.testing.assert_allclose(marked, log.position_m[row, sender], rtol=1e-5, atol=1e-3)
    per_window = counts(flood_replay, "/arena/radio/transmitter", "Points2D:positions")
    np.testing.assert_array_equal(per_window, np.bincount(row, minlength=30))


def test_robots_wear_the_colour_of_their_age(replay, two_way):
    log = two_way.log
    rgba = column(replay, "/arena/robots", "Points2D:colors").flatten().to_numpy()
    shown = np.stack([(rgba >> shift) & 255 for shift in (24, 16, 8)], axis=-1).reshape(-1, 12, 3)
    assert np.all(shown[:, log.ego] == 255)
    assert np.all(shown[~log.is_known] == palette.UNKNOWN)
    newest = log.is_known & (log.ego_age == 0.0) & (np.arange(12) != log.ego)
    assert np.all(shown[newest] == (253, 231, 37))
    luma = shown @ np.array([0.299, 0.587, 0.114])
    others = log.is_known[-1] & (np.arange(12) != log.ego)
    by_age = np.argsort(log.ego_age[-1][others])
    assert np.all(np.diff(luma[-1][others][by_age]) <= 0)


def test_robots_that_are_off_are_dark(failing, tmp_path):
    write_replay(failing.log, failing.mission, {"seed": 5}, tmp_path / "off.rrd")
    rgba = column(tmp_path / "off.rrd", "/arena/robots", "Points2D:colors").flatten().to_numpy()
    shown = np.stack([(rgba >> shift) & 255 for shift in (24, 16, 8)], axis=-1).reshape(-1, 12, 3)
    is_dark = np.all(shown == palette.SWITCHED_OFF, axis=-1)
    np.testing.assert_array_equal(is_dark, ~failing.log.is_on)
    assert np.sum(is_dark, axis=1).tolist() == [0] * 15 + [3] * 15


def test_circles_have_the_range_and_stand_around_transmitters(replay, two_way):
    log = two_way.log
    entity = "/arena/radio/range"
    assert set(rows(replay, entity, "Ellipses2D:half_sizes")) == {250.0}
    centres = rows(replay, entity, "Ellipses2D:centers", 2)
    per_window = counts(replay, entity, "Ellipses2D:centers")
    row, sender = np.nonzero(log.recipient[:, 0] != np.arange(12))
    np.testing.assert_array_equal(per_window, np.bincount(row, minlength=len(log.window)))
    expected = log.position_m[row, sender]
    for window in range(len(log.window)):
        here = np.repeat(np.arange(len(log.window)), per_window) == window
        np.testing.assert_allclose(
            sorted(centres[here].tolist()), sorted(expected[row == window].tolist()), rtol=1e-5
        )


def test_the_tree_on_the_map_joins_parents_and_children(replay, two_way):
    log = two_way.log
    strips = rows_of_strips(replay, "/arena/tree")
    row, child = np.nonzero(log.is_known & (np.arange(12) != log.ego))
    parent = log.parent[row, child]
    expected = np.stack([log.position_m[row, parent], log.position_m[row, child]], axis=1)
    np.testing.assert_allclose(strips, expected, rtol=1e-5, atol=1e-3)
