"""The figures' missions are the paper's, and the commands that are named make them."""

import shlex
import subprocess
import sys

import pytest

from swarm_mj.cli import parse
from swarm_mj.evaluation.figures.contents import FIGURES, RESULT_FIGURES
from swarm_mj.evaluation.published import published
from swarm_mj.policies.registry import POLICIES

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
def test_the_command_named_evaluates_the_drawn_policies_in_the_figures_regimes(figure, preset):
    program, *arguments = shlex.split(figure.command(preset))
    study = parse(arguments)[1].study
    assert program == "swarm-mj"
    left_out = {"sotdma"}
    if preset == "reference":
        left_out |= {"planner", "planner --payload none", "gnn"}
    if figure.task != "stationary":  # there it is spatial-tdma
        left_out |= {"planner --payload none"}
    assert set(study.policies) == set(POLICIES) - left_out
    assert study.compared_to == "tdma"
    assert {regime.preset for regime in study.regimes} == {preset}
    assert {regime.task for regime in study.regimes} == {figure.task}
    assert all("aoi" in published("mst", regime) for regime in study.regimes)
    if figure.name != "fig3":  # a receptive field is the policy's, not the mission's
        assert [getattr(r, figure.x_name) for r in study.regimes] == list(XS[figure.name])


def test_the_command_line_knows_the_figures_without_matplotlib():
    code = "import sys, swarm_mj.cli.figures; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
