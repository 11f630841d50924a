"""Charts show the numbers that they are drawn from."""

from dataclasses import replace

import matplotlib.pyplot as plt
import pytest

import swarm_mj
from swarm_mj.api import charts

SHORT = {"num_robots": 6, "num_windows": 20}


@pytest.fixture(autouse=True)
def _closed():
    plt.switch_backend("Agg")
    yield
    plt.close("all")


def test_a_flight_is_drawn_window_by_window():
    run = swarm_mj.fly("flocking", policy="tdma", **SHORT)
    age, variance = run.plot().axes
    worst, mean = age.lines
    (unheard,) = age.patches
    assert unheard.get_x() == 1.0
    assert unheard.get_x() + unheard.get_width() == run.summary.complete_window > 1
    assert list(mean.get_ydata()) == list(run.to_dataframe().aoi)
    assert list(worst.get_ydata()) == list(run.log.age_max)
    assert list(variance.lines[0].get_xdata()) == list(range(1, 21))
    assert variance.get_yscale() == "log"
    assert variance.lines[1].get_ydata()[0] == 0.01 * run.summary.velocity_variance_first
    assert len(variance.lines) == 2  # it does not agree in 20 windows
    assert not variance.texts
    assert age.get_shared_x_axes().joined(age, variance)
    assert tuple(age.figure.get_size_inches()) == pytest.approx((7.5, 1.1 + 2 * 2.1))


def test_a_flock_that_agreed_has_a_mark_and_what_is_not_shown_is_said():
    run = swarm_mj.fly("flocking", policy="tdma", num_robots=10, num_windows=200, record=False)
    variance = run.plot().axes[1]
    assert set(variance.lines[2].get_xdata()) == {run.summary.agreed_window}
    assert variance.lines[2].get_label() == f"agreed from window {run.summary.agreed_window} on"
    course = run.to_dataframe().velocity_variance
    assert (course.min() < 1e-6 * course.max()) == bool(variance.texts)
    assert variance.get_ylim()[0] >= 0.5e-6 * course.max()


def test_a_random_walk_has_no_velocity_variance_below_its_age():
    (age,) = swarm_mj.fly("random-walk", policy="tdma", record=False, **SHORT).plot().axes
    assert "age" in age.get_ylabel()


def test_a_team_at_rest_has_no_velocities_and_a_notebook_shows_its_chart_once(monkeypatch):
    run = swarm_mj.fly("stationary", policy="tdma", record=False, **SHORT)
    (age,) = run.plot().axes
    assert run.task_cost is None
    assert len(age.lines) == 1  # what was not recorded has no worst pair
    assert len(plt.get_fignums()) == 1
    monkeypatch.setattr(plt, "get_backend", lambda: "module://matplotlib_inline.backend_inline")
    run.plot()
    assert len(plt.get_fignums()) == 1


def test_a_flight_is_shaded_until_everyone_has_heard_of_everyone():
    never = swarm_mj.fly("stationary", policy="tdma", num_robots=6, num_windows=2)
    assert never.summary.complete_window is None
    (unheard,) = never.plot().axes[0].patches
    assert unheard.get_x() + unheard.get_width() == 2
    known = swarm_mj.fly("stationary", policy="tdma", num_windows=9, num_robots=2, range_ratio=3.0)
    assert known.summary.complete_window == 1
    assert list(known.plot().axes[0].patches) == []


def test_a_task_with_a_cost_of_its_own_shows_that():
    run = swarm_mj.fly("random-walk", controller="added_tasks:Formation", policy="tdma", **SHORT)
    assert run.task_cost == ("formation error", "m")
    cost = run.plot().axes[1]
    assert cost.get_ylabel() == "formation error\n[m]"
    assert list(cost.lines[0].get_ydata()) == list(run.to_dataframe().task_cost)
    assert cost.lines[0].get_ydata()[-1] == run.summary.task_cost_last


def test_policies_stand_below_each_other_the_lowest_age_first():
    found = swarm_mj.evaluate(["round-robin", "tdma"], "random-walk", num_missions=4, **SHORT)
    (axes,) = found.plot().axes
    by_age = sorted((each.result for each in found.results), key=lambda each: each.aoi_mean)
    labels = [charts.look_of(each.policy).label for each in by_age]
    assert [label.get_text() for label in axes.get_yticklabels()] == labels
    assert [line.get_xdata()[0] for line in axes.lines] == [each.aoi_mean for each in by_age]
    assert len(axes.collections) == 2  # intervals


def test_a_chart_says_the_whole_mission_and_of_two_each_its_own():
    (found,) = swarm_mj.evaluate("tdma", "random-walk", num_missions=2, **SHORT).results
    own = replace(found.result, channel="my$:Radio", scene="my:walls", arena="rooms", payload="x")
    figure = charts.draw_evaluation([found.result, own])
    plain, other = (part.get_suptitle() for part in figure.subfigs)
    for said in (plain, other):
        assert "6 robots, range ratio 0.25" in said
        assert "20 windows of exact physics, 2 missions from seed 1000" in said.replace("\n", " ")
    assert other.replace("\n", " ").endswith(r", channel my\$:Radio, scene my:walls, arena rooms")
    labels = [axes.get_yticklabels()[0].get_text() for axes in figure.axes]
    assert labels == ["tdma", "tdma +"]
    assert "95 % interval; +: larger packets; " in figure.get_supxlabel()


def test_one_mission_has_no_interval_and_flocks_have_velocities():
    age, variance = swarm_mj.evaluate("tdma", num_missions=1, **SHORT).plot().axes
    assert len(age.collections) == 0
    assert len(variance.lines) == 1
    assert age.get_shared_y_axes().joined(age, variance)
