"""Flocks trained on the age and on the velocity variance: learning curves, and their table.

    python training/reproduce.py --figures rewards
    python training/rewards_figure.py

Draws assets/figures/rewards.svg and .png from the trainings' curves, and makes a table of
docs/claims.md from them and from the flights of the policies that were kept.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from scipy.stats import mannwhitneyu

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.curves import method_of
from swarm_mj.evaluation.figures.style import draw_to, look_of, panels, styled, write_caption
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.protocol.mission_costs import AOI, VELOCITY_VARIANCE, MissionCost
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_rows

ROOT = Path(__file__).resolve().parent.parent
CURVES = ROOT / "training" / "reproduce" / "quick" / "rewards" / "curves.csv"
FLIGHTS = Path("reproduce") / "quick" / "rewards.csv"  # below the folder of results
REWARDS = {
    "age": "GNN trained on AoI",
    "variance": "GNN trained on velocity variance",
}
COSTS = (AOI, VELOCITY_VARIANCE)


@dataclass(frozen=True, kw_only=True)
class RewardsFigure:
    """Where the figure goes, and where its numbers are."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "rewards",
        "the files, without their endings",
        shown="assets/figures/rewards",
    )
    curves: Path = setting(
        CURVES,
        "the learning curves",
        metavar="FILE",
        shown="training/reproduce/quick/rewards/curves.csv",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        draw_to(self.out, lambda: draw(read_curves(self.curves)))
        return DONE


@dataclass(frozen=True, kw_only=True)
class Trained:
    """The S trainings on one reward, at each of E evaluations."""

    reward: str  # a key of `REWARDS`
    decisions: Float[np.ndarray, "E"]
    aoi: Float[np.ndarray, "S E"]  # held-out age [windows]
    velocity_variance: Float[np.ndarray, "S E"]  # held-out, mean over windows [m²/s²]

    def of(self, cost: MissionCost) -> Float[np.ndarray, "S E"]:
        """Return the values of a cost."""
        return getattr(self, cost.column)


def read_curves(path: Path) -> list[Trained]:
    """Return the trainings of each reward.

    Raises:
        ValueError: The file cannot be read, or trainings were evaluated at different times.
    """
    by_training: dict[str, list[dict[str, str]]] = {}
    for _, row in read_rows(path, "learning curves"):
        by_training.setdefault(row["training"], []).append(row)
    found = []
    for reward in REWARDS:
        rows = [its for name, its in by_training.items() if name.startswith(f"{reward}-")]
        decisions = [[float(row["decisions"]) for row in its] for its in rows]
        if not rows or any(each != decisions[0] for each in decisions):
            raise ValueError(f"{path} has no trainings on {reward}, or not all evaluated alike")
        found.append(
            Trained(
                reward=reward,
                decisions=np.array(decisions[0]),
                aoi=np.array([[float(row["aoi"]) for row in its] for its in rows]),
                velocity_variance=np.array(
                    [[float(row["velocity_variance"]) for row in its] for its in rows]
                ),
            )
        )
    return found


def draw(trained: Sequence[Trained]) -> Figure:
    """Draw the median of each reward's trainings, with a band from the least to the greatest."""
    with styled():
        title = "Flocks of 10 trained on the age and on the velocity variance"
        figure, (ages, variances) = panels(title, rows=2, height_in=4.6)
        for axes, cost in zip((ages, variances), COSTS, strict=True):
            for each in trained:
                look = look_of(REWARDS[each.reward])
                low, median, high = np.quantile(each.of(cost), (0.0, 0.5, 1.0), axis=0)
                band = {"color": look.colour, "alpha": 0.15, "linewidth": 0.0}
                axes.fill_between(each.decisions, low, high, **band)
                line = {"color": look.colour, "marker": look.marker, "markersize": 4.0}
                axes.plot(each.decisions, median, label=look.label, **line)
            axes.set_yscale("log")
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_minor_locator(NullLocator())
            axes.yaxis.set_major_formatter("{x:g}")
            axes.set_title(cost.label)
        variances.set_xlabel("team decisions")
        ages.legend(frameon=False, loc="upper left")
        num = len(trained[0].aoi)
        write_caption(figure, f"held-out missions; medians of {num} trainings, and all of them")
    return figure


def table(folder: Path) -> str:
    """Return how the trainings on either reward end and fly, as Markdown."""
    age, variance = read_curves(CURVES)
    head = [f"median (least to greatest) of {len(age.aoi)} trainings"]
    head += ["trained on the age", "on the velocity variance", "p"]
    lines: list[list[str]] = []
    for cost in COSTS:
        last = (each.of(cost)[:, -1] for each in (age, variance))
        lines.append(_row(f"{cost.title}, at the end of training", *last))
    swings = [_swings(each.aoi) for each in (age, variance)]
    lines.append(_row("mean change of the age between two evaluations", *swings))
    for ratio in (0.15, 0.5):
        for cost in COSTS:
            flown = [_flown(folder / FLIGHTS, REWARDS[name], ratio, cost) for name in REWARDS]
            lines.append(_row(f"{cost.title} of the policies kept, velocity {ratio:g}", *flown))
    return markdown_table(head, lines)


def _swings(values: Float[np.ndarray, "S E"]) -> Float[np.ndarray, "S"]:
    """Return how much each training's curve rises or falls from evaluation to evaluation."""
    return np.mean(np.abs(np.diff(values, axis=1)), axis=1)


def _flown(
    path: Path, method: str, velocity_ratio: float, cost: MissionCost
) -> Float[np.ndarray, "S"]:
    """Return the mean cost that each training's policy had in its flights."""
    chosen = [
        getattr(result, f"{cost.column}_mean")
        for result in read_results(path)
        if method_of(result) == method and result.velocity_ratio == velocity_ratio
    ]
    return np.array(chosen)


def _row(name: str, of_age: Float[np.ndarray, "S"], of_variance: Float[np.ndarray, "S"]) -> list:
    """Return a row, with the two-sided p of Mann and Whitney's test that both are alike."""
    tested = cast(Any, mannwhitneyu(of_age, of_variance))  # stubs have an empty class
    return [name, _shown(of_age), _shown(of_variance), f"{float(tested.pvalue):.2g}"]


def _shown(values: Float[np.ndarray, "S"]) -> str:
    low, median, high = np.quantile(values, (0.0, 0.5, 1.0))
    return f"{median:.3g} ({low:.3g} to {high:.3g})"


if __name__ == "__main__":
    sys.exit(script(RewardsFigure, RewardsFigure.__call__))
