"""The chart of large teams has the numbers of its table."""

import re
from pathlib import Path

import large_teams_figure as program
import numpy as np
import pytest

from swarm_mj.evaluation.figures.curves import Curve
from swarm_mj.evaluation.results import read_results

ROOT = Path(__file__).parents[2]
SIZES = (10, 20, 40, 80, 200, 400, 1000)


@pytest.fixture(scope="module")
def curves():
    results = read_results(ROOT / "training" / "results" / "large-random-walk.csv")
    return {curve.method: curve for curve in program.own_curves(results)}


def test_the_table_has_the_numbers_and_exponents_of_the_curves(curves):
    text = (ROOT / "docs" / "results.md").read_text()
    rows = text.partition("## Large teams")[2].partition("![")[0]
    table = dict(re.findall(r"^\| `([\w-]+)` \| (.*) \|$", rows, re.MULTILINE))
    assert table.keys() == curves.keys()
    for method, curve in curves.items():
        *ages, power = table[method].split(" | ")
        pairs = zip(curve.mean, curve.sem, strict=True)
        said = [f"{mean:.1f} ± {sem:.1f}" for mean, sem in pairs]
        assert [age.strip() for age in ages if age.strip()] == said
        assert power.strip() == (f"{program.exponent(curve):.2f}" if len(said) > 4 else "")


def test_the_exponent_is_that_of_large_teams():
    sizes = np.array(SIZES, dtype=float)
    mean = np.where(sizes < 200, 1.0, 3.0 * sizes**0.5)
    curve = Curve(method="a", x=sizes, mean=mean, sem=mean)
    assert program.exponent(curve) == pytest.approx(0.5)
