"""Tables of docs/claims.md whose numbers no single result has: they are computed from several."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from results_rows import PAPER, Row, Rows, read, select
from scipy.stats import spearmanr

from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.evaluation.published import BASELINES, FLOCKING, TRANSMIT_POWER
from swarm_mj.system.reading import read_rows

ROOT = Path(__file__).resolve().parent.parent
TRAINED = ROOT / "training" / "reproduce" / "quick"  # the trainings, a folder for each figure
OURS = ["one GNN", "one GNN, seed 2", "one GNN, seed 3"]
INFORMED = ("planner", "planner --payload none", "greedy-oracle", "lookahead-oracle")


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How much younger the information is with the GNN than with the best baseline."""

    windows: float
    windows_sem: float
    share: float  # of the baseline's age
    share_sem: float


def margins(folder: Path) -> str:
    """Return the GNNs' margins over the best baseline, here and as published (Fig. 4)."""
    head = ["margin over the best baseline, by range ratio [km]", *map(_short, TRANSMIT_POWER.xs)]
    rows: list[list[str]] = []
    for whose, ours, gnns, theirs in (
        ("ours", ["reproduce/quick/one"], OURS, ["paper-stationary"]),
        ("published", [PAPER], ["GNN"], [PAPER]),
    ):
        in_windows = [f"{whose} [windows]"]
        in_percent = [f"{whose} [%]"]
        for ratio in TRANSMIT_POWER.xs:
            place = {"task": "stationary", "range_ratio": ratio, "figure": ["fig4", "none"]}
            found = margin(
                select(read(ours, folder), {"policy": gnns} | place),
                select(read(theirs, folder), {"policy": [*BASELINES]} | place),
            )
            in_windows.append(f"{found.windows:.1f} ± {found.windows_sem:.1f}")
            in_percent.append(f"{100.0 * found.share:.0f} ± {100.0 * found.share_sem:.0f}")
        rows += [in_windows, in_percent]
    return markdown_table(head, rows)


def margin(gnns: Rows, baselines: Rows) -> Margin:
    """Return the margin of trainings that flew the same missions over the baseline of least age.

    Errors are of missions, and as if the baseline had flown others.
    """
    if not (gnns and baselines):
        raise ValueError("a margin needs a GNN and a baseline")
    best = min(baselines, key=lambda row: row["aoi_mean"])
    age = float(np.mean([row["aoi_mean"] for row in gnns]))
    error = float(np.mean([row["aoi_sem"] for row in gnns]))
    ratio = age / best["aoi_mean"]
    return Margin(
        windows=best["aoi_mean"] - age,
        windows_sem=math.hypot(error, best["aoi_sem"]),
        share=1.0 - ratio,
        share_sem=ratio * math.hypot(error / age, best["aoi_sem"] / best["aoi_mean"]),
    )


def correlation(folder: Path) -> str:
    """Return the rank correlations of age and velocity variance over the policies (Fig. 6)."""
    flown = read(["paper-flocking"], folder)
    head = ["rank correlation, by velocity ratio", *map(_short, FLOCKING.xs)]
    rows: list[list[str]] = []
    for name, left_out in (
        ("all policies", ()),
        ("without `planner` and the oracles", INFORMED),
    ):
        policies = [row for row in flown if row["policy"] not in left_out]
        cells = [
            f"{rank_correlation(select(policies, {'velocity_ratio': ratio})):.2f}"
            for ratio in FLOCKING.xs
        ]
        count = len({row["policy"] for row in policies})
        rows.append([f"{name} ({count})", *cells])
    return markdown_table(head, rows)


def rank_correlation(rows: Sequence[Row]) -> float:
    """Return Spearman's coefficient of the mean ages and the mean velocity variances."""
    ages = [row["aoi_mean"] for row in rows]
    variances = [row["velocity_variance_mean"] for row in rows]
    found = cast(Any, spearmanr(ages, variances))  # stubs have an empty class
    return float(found.statistic)


def trainings(_folder: Path, trained: Path = TRAINED) -> str:
    """Return how much each figure's GNNs were trained: seeds, decisions, minutes and commit."""
    head = ["figure", "trainings", "seeds", "team decisions of each", "minutes in all", "commit"]
    rows: list[list[str]] = []
    for path in sorted(trained.glob("*/trainings.csv")):
        its = _table(path)
        decisions = sorted(int(row["decisions"]) for row in its)
        ends = dict.fromkeys(f"{each:,}" for each in (decisions[0], decisions[-1]))
        rows.append(
            [
                path.parent.name,
                str(len(its)),
                _listed(str(json.loads(row["settings"])["seed"]) for row in its),
                " to ".join(ends),
                f"{sum(float(row['minutes']) for row in its):.0f}",
                _listed(row["commit"] for row in its),
            ]
        )
    if not rows:
        raise ValueError(f"{trained} has no table of trainings")
    return markdown_table(head, rows)


def _table(path: Path) -> list[dict[str, str]]:
    return [row for _, row in read_rows(path, "table of trainings")]


def _listed(values: Iterable[Any]) -> str:
    return ", ".join(sorted(set(values)))


def _short(value: float) -> str:
    return f"{value:g}"
