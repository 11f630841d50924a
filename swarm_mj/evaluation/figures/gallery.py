"""Any of the figures by its name."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from swarm_mj.evaluation.figures.contents import FLOCK, RESULT_FIGURES
from swarm_mj.evaluation.figures.curves import preset_of
from swarm_mj.evaluation.figures.drawing import draw
from swarm_mj.evaluation.figures.flock import draw_flock
from swarm_mj.evaluation.results import Result


def draw_figure(
    name: str, results: Sequence[Result], *, flock_policy: str, flock_seed: int
) -> Figure:
    """Draws a figure.

    Args:
        name: One of `FIGURES`.
        results: One or more, of one preset.
        flock_policy: Who talks to whom in the flock's mission.
        flock_seed: That mission's.

    Returns:
        The drawing.

    Raises:
        ValueError: The results hold no point of it or cannot be compared, or no such flock flies.
    """
    if name == FLOCK:
        return draw_flock(preset_of(results), flock_policy, flock_seed)
    return draw(RESULT_FIGURES[name], results)
