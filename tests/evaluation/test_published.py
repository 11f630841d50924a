"""The paper's numbers and where they apply; the commands named make its figures' missions."""

import csv
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from swarm_mj.cli import parse
from swarm_mj.evaluation import published as module
from swarm_mj.evaluation.published import BASELINES, FIGURES, RESULT_FIGURES, points, published
from swarm_mj.mission import PAPERS, PRESETS, WORLDS, paper, reference
from swarm_mj.policies.registry import POLICIES

FILE = Path(module.__file__).with_name("published.csv")


def test_every_row_of_the_file_is_a_point():
    with FILE.open() as file:
        rows = [
            (row["figure"], row["method"], row["x_name"], float(row["x"]), float(row["mean"]))
            for row in csv.DictReader(file)
        ]
    assert rows == [(p.figure, p.method, p.x_name, p.x, p.mean) for p in points()]
    assert {p.method for p in points()} > {*BASELINES}
    assert set(BASELINES) <= set(POLICIES)


def test_standard_error_is_a_tenth_of_the_deviation():
    """100 missions a point."""
    (point,) = published("mst", reference("stationary")).values()
    assert (point.mean, point.std) == (43.3069, 9.7449)
    assert point.sem == pytest.approx(0.97449)


@pytest.mark.parametrize("preset", WORLDS)
def test_the_paper_reports_nothing_of_other_worlds(preset):
    assert published("round-robin", PRESETS[preset]()) == {}


@pytest.mark.parametrize("preset", PAPERS)
def test_each_figures_regime_has_its_value(preset):
    make = PAPERS[preset]

    def means(policy, task, **overrides):
        return {cost: p.mean for cost, p in published(policy, make(task, **overrides)).items()}

    assert means("round-robin", "stationary", range_ratio=1.0) == {"aoi": 18.0736}
    assert means("round-robin", "stationary") == {"aoi": 47.2777}
    assert means("mst", "stationary", velocity_ratio=0.5) == {"aoi": 43.3069}
    assert means("round-robin", "random-walk", num_robots=10) == {"aoi": 7.1003}
    assert means("random-flooding", "random-walk") == {"aoi": 50.0638}
    expected = {"aoi": 46.3437, "velocity_variance": 0.8244}
    assert means("mst", "flocking", velocity_ratio=0.325) == expected


@pytest.mark.parametrize(
    "mission",
    [
        paper("stationary", num_windows=499),
        paper("stationary", num_robots=41),
        paper("stationary", range_ratio=0.3),
        paper("random-walk", range_ratio=0.5),
        paper("random-walk", velocity_ratio=0.25),
        paper("random-walk", num_robots=30),
        paper("flocking", boundary="reflect"),
        paper("flocking", range_ratio=0.5),
        paper("flocking", physics="contact"),
        paper("flocking", prior_knowledge="start"),
        reference("flocking", velocity_ratio=0.25, sinr_threshold_db=2.0),
    ],
)
def test_other_regimes_have_none(mission):
    assert published("mst", mission) == published("GNN", paper("stationary")) == {}


# The paper's captions and x axes.
XS = {
    "fig3": (0, 1, 2, 3, 4, 5),
    "fig4": (0.2, 0.25, 0.5, 0.75, 1.0),
    "fig5": (10, 20, 40, 60, 80),
    "fig6": (0.15, 0.25, 0.325, 0.5),
}


def test_the_figures_are_the_papers():
    assert FIGURES == ("fig2", "fig3", "fig4", "fig5", "fig6")
    assert {name: figure.xs for name, figure in RESULT_FIGURES.items()} == XS


@pytest.mark.parametrize("preset", ["paper", "reference"])
@pytest.mark.parametrize("figure", RESULT_FIGURES.values(), ids=lambda figure: figure.name)
def test_the_command_named_evaluates_the_figures_regimes(figure, preset):
    program, *arguments = shlex.split(figure.command(preset))
    study = parse(arguments)[1].study
    assert program == "swarm-mj"
    assert {regime.preset for regime in study.regimes} == {preset}
    assert {regime.task for regime in study.regimes} == {figure.task}
    assert all("aoi" in published("mst", regime) for regime in study.regimes)
    if figure.name != "fig3":  # a receptive field is the policy's, not the mission's
        assert [getattr(r, figure.x_name) for r in study.regimes] == list(XS[figure.name])


def test_the_command_line_knows_the_figures_without_matplotlib():
    code = "import sys, swarm_mj.cli.figures; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
