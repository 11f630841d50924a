"""How many missions converge by when, beside the claim that was checked."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from swarm_mj.evaluation.figures import style

if TYPE_CHECKING:  # which draws itself by this
    from swarm_mj.evaluation.convergence import Convergence

HEIGHT_IN = 3.8
SAID = {"holds": "holds", "does not hold": "does not hold", "not decided": "is not decided"}


def draw_convergence(found: "Convergence") -> Figure:
    """Return a chart of the share of missions that had converged, over time, beside the claim.

    Args:
        found: What a check found.

    Returns:
        The figure: the share as a step for each mission, the claim as a cross of two lines, and the
        true share's interval as a bar.
    """
    goal = found.goal
    end_s = found.mission.num_windows * found.mission.window_s
    times_s = np.sort(found.seconds[np.isfinite(found.seconds)])
    shares = np.arange(1, len(times_s) + 1) / found.num_missions
    colour = style.look_of(found.policy).colour
    last = shares[-1] if len(shares) else 0.0
    low, high = found.interval
    with style.styled():
        mission = found.mission
        who = f"{mission.task}, {mission.num_robots} robots, {found.policy}"
        title = f"{who}: the claim {SAID[found.verdict]}"
        figure, (axes,) = style.panels(title, rows=1, height_in=HEIGHT_IN)
        steps_s = [0.0, *times_s, end_s]
        label = f"{found.num_missions} missions, {found.cost}"
        axes.step(steps_s, [0.0, *shares, last], where="post", color=colour, label=label)
        axes.axvline(goal.within_s, color=style.FAINT, linewidth=0.8, linestyle=":")
        label = f"claim: at least {goal.share:.0%} within {goal.within_s:g} s"
        axes.axhline(goal.share, color=style.FAINT, linewidth=0.8, linestyle=":", label=label)
        label = f"true share: {low:.1%} to {high:.1%}, at {100 * goal.level:g}% confidence"
        axes.vlines(goal.within_s, low, high, color=colour, linewidth=5.0, alpha=0.4, label=label)
        axes.set(xlabel="time [s]", ylabel="share of missions\nthat had converged")
        axes.set_xlim(0.0, end_s)
        axes.set_ylim(0.0, 1.02)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        # Below: the course may run through every corner.
        axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.2))
        config = found.config
        style.write_caption(figure, style.code(config["version"], config["commit"]))
    return style.kept(figure)
