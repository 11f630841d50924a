"""Figures by their names."""

import pytest
from synthetic import everything

from swarm_mj.evaluation.figures.contents import FIGURES
from swarm_mj.evaluation.figures.gallery import draw_figure


@pytest.mark.parametrize("name", FIGURES)
def test_every_name_draws_its_figure_under_the_results_preset(name):
    drawing = draw_figure(name, everything("paper"), flock_policy="round-robin", flock_seed=2)
    caption = drawing.texts[-1].get_text()
    assert caption.startswith(f"{name}, preset paper: ")
    assert ("policy round-robin, seed 2" in caption) == (name == "fig2")
