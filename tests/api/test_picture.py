"""Pictures of one window, against what was recorded of it."""

import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.patches import Polygon, Rectangle
from matplotlib.quiver import Quiver

import swarm_mj
from swarm_mj.api.picture import draw_picture
from swarm_mj.replay.read import read_footage

WALK = {"num_robots": 8, "num_windows": 20, "velocity_ratio": 0.6}


@pytest.fixture(scope="module")
def run():
    return swarm_mj.fly("random-walk", policy="mst", seed=3, observer=2, **WALK)


@pytest.fixture(autouse=True)
def _closed():
    plt.switch_backend("Agg")
    yield
    plt.close("all")


def of_kind(axes, kind):
    return [each for each in axes.get_children() if type(each) is kind]


def texts(figure):
    return [each.get_text() for each in figure.texts]


def test_robots_stand_where_they_were_in_the_replays_colours(run):
    figure = run.picture(7)
    places, area = figure.axes[0], run.mission.half_side_m
    (robots,) = of_kind(places, PathCollection)
    assert np.array_equal(robots.get_offsets(), run.log.position_m[6])
    assert np.allclose(robots.get_facecolors()[:, :3] * 255.0, run.log.colours[6])
    assert np.allclose(robots.get_facecolors()[2], 1.0)  # the observer is white
    walls = [each for each in of_kind(places, Rectangle) if each.get_width() == 2.0 * area]
    assert [each.get_xy() for each in walls] == [(-area, -area)]
    low, high = places.get_xlim()
    assert low < -area < area < high
    assert places.get_xlabel() == "x [m]"
    width, height = figure.get_size_inches()
    assert width / height == pytest.approx(16 / 9)


def test_trails_end_at_the_robots_and_a_team_at_rest_has_none(run):
    trails = of_kind(run.picture(20).axes[0], LineCollection)
    first, last = (each.get_segments()[5] for each in (trails[0], trails[-1]))
    assert np.array_equal(first[0], run.log.position_m[0, 5])
    assert np.array_equal(last[-1], run.log.position_m[19, 5])
    assert trails[0].get_alpha() < trails[-1].get_alpha()
    small = {"policy": "mst", "num_robots": 4, "num_windows": 3, "range_ratio": 2.0}
    for task in ("stationary", "flocking"):  # which moves less than a robot's size so soon
        still = swarm_mj.fly(task, **small).picture()
        assert of_kind(still.axes[0], LineCollection) == []
        assert "trail" not in " ".join(each.get_text() for each in still.legends[0].get_texts())


def test_packets_heard_in_the_window_are_arrows(run):
    packets = run.log.packets["delivered"].row
    busy = int(np.bincount(packets).argmax())
    figure = run.picture(busy + 1)
    arrows = {len(each.X) for each in of_kind(figure.axes[0], Quiver)}
    assert int(np.sum(packets == busy)) in arrows
    (legend,) = figure.legends
    assert "packet delivered" in [each.get_text() for each in legend.get_texts()]


def test_the_title_says_mission_policy_seed_and_time(run):
    said = texts(run.picture())
    assert said[0] == "mst"
    assert "random-walk, 8 robots, seed 3" in said
    assert "2.0 s, window 20 of 20" in said
    assert f"mean age of information: {run.log.age_mean[-1]:.1f} windows" in said


def test_a_replay_that_is_read_back_gives_the_same_picture(run, tmp_path):
    footage = read_footage(run.save(tmp_path / "a.rrd"))
    live, read = run.picture(9), draw_picture(footage, 9)
    assert texts(live) == texts(read)
    drawn = [of_kind(figure.axes[0], PathCollection)[0] for figure in (live, read)]
    assert np.allclose(drawn[0].get_offsets(), drawn[1].get_offsets(), atol=1e-3)
    assert np.array_equal(drawn[0].get_facecolors(), drawn[1].get_facecolors())


def test_obstacles_and_the_channel_are_shown():
    city = {"preset": "urban", "num_robots": 20, "num_windows": 2, "bit_rate": 1e6}
    figure = swarm_mj.fly("random-walk", policy="gossip", **city).picture()
    assert len(of_kind(figure.axes[0], Polygon)) == 16  # blocks, 4 by 4
    assert "preset urban, 1 Mbit/s" in texts(figure)


@pytest.mark.slow
def test_obstacles_are_drawn_without_rerun():
    """In a process of its own, for others here import it."""
    code = (
        "import sys, swarm_mj; sys.modules['rerun'] = None; "
        "swarm_mj.fly('random-walk', policy='gossip', preset='urban', num_windows=2).picture()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_no_such_window_and_nothing_recorded_are_refused(run):
    with pytest.raises(ValueError, match="window must be from 1 to 20, not 21"):
        run.picture(21)
    blind = swarm_mj.fly("random-walk", policy="tdma", record=False, **WALK)
    with pytest.raises(ValueError, match="fly with record=True"):
        blind.picture()
