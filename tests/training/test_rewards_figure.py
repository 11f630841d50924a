import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from rewards_figure import (
    RewardsFigure,
    _row,
    _swings,
    draw,
    read_curves,
    table,
)

from swarm_mj.system.exit_codes import DONE

HEADER = "training,decisions,aoi,velocity_variance\n"


@pytest.fixture
def curves(tmp_path):
    """Three trainings on each reward: ages fall with one and rise with the other."""
    lines = [
        f"{reward}-{seed},{decisions},{age + seed},{0.1 * seed}"
        for reward, slope in (("age", -1.0), ("variance", 1.0))
        for seed in (1, 2, 3)
        for decisions, age in ((0, 10.0), (5000, 10.0 + slope), (10000, 10.0 + 4.0 * slope))
    ]
    path = tmp_path / "curves.csv"
    path.write_text(HEADER + "\n".join(lines) + "\n")
    return path


def test_trainings_are_read_by_reward(curves):
    age, variance = read_curves(curves)
    np.testing.assert_allclose(age.aoi, [[11, 10, 7], [12, 11, 8], [13, 12, 9]])
    np.testing.assert_allclose(variance.aoi[:, -1], [15, 16, 17])
    np.testing.assert_allclose(age.velocity_variance[:, 0], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(_swings(age.aoi), 2.0)  # of 1 and 3


def test_medians_stand_within_their_bands(curves):
    figure = draw(read_curves(curves))
    FigureCanvasAgg(figure).draw()
    ages, variances = figure.axes
    lines = {line.get_label(): line for line in ages.lines}
    np.testing.assert_allclose(lines["GNN, on AoI"].get_ydata(), [12, 11, 8])
    assert len(ages.collections) == len(variances.collections) == 2
    assert "medians of 3 trainings" in figure.get_supxlabel()


def test_it_is_written_twice(curves, tmp_path):
    assert RewardsFigure(out=tmp_path / "figure", curves=curves)() == DONE
    assert {path.name for path in tmp_path.glob("figure.*")} == {"figure.png", "figure.svg"}


def test_a_row_has_medians_extremes_and_a_test():
    """Of 4 against 4 that do not overlap, two of 70 orders are as extreme."""
    row = _row("x", np.array([1.0, 2.0, 3.0, 4.0]), np.array([5.0, 6.0, 7.0, 8.0]))
    assert row == ["x", "2.5 (1 to 4)", "6.5 (5 to 8)", "0.029"]


def test_trainings_that_were_not_evaluated_alike_are_refused(curves):
    curves.write_text(curves.read_text() + "age-9,0,1,1\n")
    with pytest.raises(ValueError, match="no trainings on age, or not all evaluated alike"):
        read_curves(curves)


def test_the_committed_flights_make_a_table():
    from experiments import ROOT

    rows = table(ROOT / "training" / "results").splitlines()
    assert len(rows) == 2 + 3 + 4
    assert all(row.count("|") == 5 for row in rows)
