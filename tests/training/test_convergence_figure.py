import numpy as np
import pytest
from convergence_figure import (
    COURSES,
    LATE,
    ConvergenceFigure,
    draw,
    fresh_factor,
    late_table,
    read_courses,
    start_table,
)
from matplotlib.backends.backend_agg import FigureCanvasAgg

from swarm_mj.mission import paper
from swarm_mj.system.exit_codes import DONE

HEADER = "policy,window,variance_p10,variance_median,variance_p90,known_mean,episodes,seed,commit\n"


@pytest.fixture
def folder(tmp_path):
    """Flocks of two policies, whose variance falls to 0.9 and 0.95 of it in each window."""
    lines = [
        f"{policy},{window},{3 * left**window},{5 * left**window},{6 * left**window},{known},7,3,ab"
        for policy, left, known in (("tdma", 0.9, 4.0), ("mst", 0.95, 40.0))
        for window in range(1, 501)
    ]
    (tmp_path / COURSES).write_text(HEADER + "\n".join(lines) + "\n")
    return tmp_path


def test_courses_are_read_by_policy(folder):
    tdma, mst = read_courses(folder / COURSES)
    assert (tdma.policy, mst.policy) == ("tdma", "mst")
    assert tdma.origin == "7 missions, seeds 3 to 9; commit ab"
    np.testing.assert_allclose(mst.median[:2], [4.75, 5 * 0.95**2])
    np.testing.assert_allclose((tdma.low[0], tdma.high[0], tdma.known[0]), (2.7, 5.4, 4.0))


def test_the_law_stands_beside_the_medians_and_their_bands(folder):
    mission = paper("flocking")
    figure = draw(read_courses(folder / COURSES), mission)
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    lines = {line.get_label(): line for line in axes.lines}
    law = lines["perfect knowledge"]
    assert law.get_xdata()[0] == pytest.approx(0.1)
    np.testing.assert_allclose(law.get_ydata()[:2], [5.85 * 0.81, 5.85 * 0.81**2])
    np.testing.assert_allclose(lines["tdma"].get_ydata()[0], 4.5)
    assert len(axes.collections) == 2
    assert axes.get_yscale() == "log"
    assert "7 missions, seeds 3 to 9; commit ab" in figure.get_supxlabel()
    shown = {text.get_text() for text in axes.get_legend().get_texts()}
    assert shown == {"tdma", "mst", "perfect knowledge"}


def test_it_is_written_twice(folder):
    program = ConvergenceFigure(out=folder / "figure", results=folder)
    assert program() == DONE
    assert {path.name for path in folder.glob("figure.*")} == {"figure.png", "figure.svg"}


def test_fresh_news_of_all_is_the_law_and_of_none_leaves_all():
    assert fresh_factor(40, 40, 0.1) == pytest.approx(0.81)
    assert fresh_factor(1, 40, 0.1) == pytest.approx(1.0)


def test_fresh_news_of_some_by_many_draws():
    """Each of 20 robots aims at the mean of itself and 4 others, drawn anew."""
    rng = np.random.default_rng(0)
    left = []
    for _ in range(4000):
        velocity = rng.uniform(-1.0, 1.0, 20)
        before = np.var(velocity)
        aims = np.empty(20)
        for i in range(20):
            others = rng.permutation(np.delete(np.arange(20), i))[:4]
            aims[i] = np.mean(velocity[[i, *others]])
        left.append(np.var(velocity + 0.1 * (aims - velocity)) / before)
    assert np.mean(left) == pytest.approx(fresh_factor(5, 20, 0.1), abs=0.001)


def test_the_first_table_has_robots_known_what_is_left_and_what_they_make_of_it(folder):
    head, _, first, *more = start_table(folder).splitlines()
    assert head == "| windows | `tdma` | `mst` |"
    # c = 36 / (4 * 39)
    assert first == "| 1 to 5 | 4.0: 0.90, 0.85 | 40.0: 0.95, 0.81 |"
    assert len(more) == 3


def test_the_second_table_has_ages_late_rates_and_what_the_ages_make_of_them(folder):
    (folder / LATE).write_text(
        "policy,num_robots,age_mean,late_rate,stale_rate\ntdma,10,3.7,0.2147,0.183\n"
        "tdma,20,9.96,,0.14\n"
    )
    assert late_table(folder).splitlines() == [
        "| policy | 10 robots | 20 robots |",
        "| --- | --- | --- |",
        "| `tdma` | 4: 0.215, 0.183 | 10: -, 0.140 |",
    ]
