"""The table of impairments has the numbers of its results, and the arithmetic of ratios."""

from dataclasses import replace
from pathlib import Path

import impairments_figure as program
import numpy as np
import pytest

from swarm_mj.evaluation.results import read_results

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def found():
    return read_results(program.RESULTS)


def test_the_docs_have_the_table_that_the_results_make(found):
    assert program.table(found) in (ROOT / "docs" / "results.md").read_text()


def test_all_results_are_of_one_commit(found):
    assert len({result.commit for result in found}) == 1


def test_a_ratio_is_an_age_over_that_without_the_impairment(found):
    doubled = [
        replace(r, aoi_mean=20.0 if program.impairment(r) not in program.USUAL else 10.0)
        for r in found
    ]
    policies, names, ratio = program.ratios(doubled)
    assert ratio.shape == (3, len(policies), len(names))
    np.testing.assert_allclose(ratio, 2.0)


def test_impairments_have_a_name_each(found):
    names = list(dict.fromkeys(map(program.impairment, found)))
    assert names == [
        "none",
        "30% of packets lost",
        "bursts, 0.02 per slot",
        "30% of robots fail",
        "clocks 20 ms apart",
        "clocks 50 ms apart",
        "clocks drift 800 ppm",
        "correct map",
        "map 50 m off",
    ]
