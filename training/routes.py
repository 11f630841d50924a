"""Whom does `gnn` address: teammates nearby, over routes that are in use (claim 14 of the paper)?

    python training/routes.py

Teams at rest fly, and each request is compared with what a draw among those that the robot could
have addressed would give: known teammates within 1.2 ranges. A teammate is on a route if it was
heard directly and other robots' news came over it, by P in the robot's own buffer. Writes
`training/results/routes.csv`.
"""

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from rich.console import Console
from rich.table import Table

from swarm_mj import Swarm, make_policy, paper
from swarm_mj.cli import script
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.scales import ADDRESS_RANGES
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.terminal import WorkBar
from swarm_mj.system.writing import Output, check_outputs, write_csv

ROOT = Path(__file__).resolve().parent.parent
POLICIES = ("gnn", "mst")
BATCH = 25  # missions side by side
NEAR = 0.5  # a teammate within this distance is near [ranges]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Which missions fly, and where the table goes."""

    out: Path = setting(
        ROOT / "training" / "results" / "routes.csv",
        "the table",
        metavar="FILE",
        shown="training/results/routes.csv",
    )
    ratios: tuple[float, ...] = setting((0.2, 0.25, 0.5, 1.0), "range ratios", low=0.01, high=10.0)
    num_missions: int = setting(100, "missions of each", low=2, high=10_000)
    num_robots: int = setting(40, "robots of a team", low=2, high=200)
    num_windows: int = setting(500, "windows of a mission", low=1, high=100_000)
    seed: int = setting(4500, "of the first mission", low=0, high=10**9)


class Teammate(NamedTuple):
    """What is true of a teammate, or the mean over several."""

    apart_ranges: float  # its distance
    near: float  # whether it is nearer than half a range
    on_route: float  # whether other robots' news came over it


@dataclass(frozen=True, kw_only=True)
class Addressed:
    """Whom robots of a mission addressed, as means over its requests."""

    requests_per_window: float
    chosen: Teammate
    drawn: Teammate  # among those that the robot could have addressed


@dataclass(frozen=True, kw_only=True)
class RouteRow:
    """Means over missions, with their standard errors."""

    policy: str
    range_ratio: float
    requests_per_window: float
    apart_ranges_mean: float
    apart_ranges_sem: float
    drawn_apart_ranges_mean: float
    near_mean: float
    near_sem: float
    drawn_near_mean: float
    on_route_mean: float
    on_route_sem: float
    drawn_on_route_mean: float
    episodes: int
    seed: int  # of the first mission
    commit: str | None


def on_route(parent: Int[np.ndarray, "B N N"]) -> Bool[np.ndarray, "B N N"]:
    """Return whether robot i heard j directly, and other robots' news over it, by its own P.

    Args:
        parent: P^{i,k}, over which robot k's state came to i, -1 where it did not come by radio.
    """
    num_robots = parent.shape[1]
    direct = parent == np.arange(num_robots)[None, :, None]
    carries = np.zeros_like(direct)
    b, i, k = np.nonzero((parent >= 0) & ~direct)
    carries[b, i, parent[b, i, k]] = True
    return direct & carries


def addressed(mission: Mission, policy: str, seeds: Sequence[int], bar: WorkBar) -> list[Addressed]:
    """Fly missions side by side; return whom their robots addressed, of each that addressed any."""
    swarm = Swarm(mission, seeds)
    swarm.start(make_policy(policy, mission))
    everyone = np.arange(mission.num_robots)
    position_m = swarm.states.position_m  # they rest
    apart = np.linalg.norm(position_m[:, :, None] - position_m[:, None], axis=3) / mission.range_m
    is_near = apart < NEAR
    chosen: list[list[Teammate]] = [[] for _ in seeds]
    drawn: list[list[Teammate]] = [[] for _ in seeds]
    for _ in range(mission.num_windows):
        is_routed = on_route(swarm.buffers.parent)
        can_address = swarm.buffers.is_known & (apart <= ADDRESS_RANGES)
        can_address[:, everyone, everyone] = False
        swarm.step()
        recipient = swarm.phases[0].recipient
        for b, i in np.argwhere(recipient != everyone).tolist():
            j = recipient[b, i]
            if can_address[b, i, j]:  # else it knows nothing of j yet
                whom = everyone == j
                chosen[b].append(_teammate(apart[b, i], is_near[b, i], is_routed[b, i], whom))
                whom = can_address[b, i]
                drawn[b].append(_teammate(apart[b, i], is_near[b, i], is_routed[b, i], whom))
        bar.advance(len(seeds))
    found: list[Addressed] = []
    for its_chosen, its_drawn in zip(chosen, drawn, strict=True):
        if its_chosen:
            found.append(
                Addressed(
                    requests_per_window=len(its_chosen) / mission.num_windows,
                    chosen=_mean(np.array(its_chosen)),
                    drawn=_mean(np.array(its_drawn)),
                )
            )
    return found


def _teammate(
    apart: Float[np.ndarray, "N"],
    is_near: Bool[np.ndarray, "N"],
    is_routed: Bool[np.ndarray, "N"],
    whom: Bool[np.ndarray, "N"],
) -> Teammate:
    """Return the mean over those teammates of a robot that are meant."""
    return Teammate(
        apart_ranges=float(np.mean(apart[whom])),
        near=float(np.mean(is_near[whom])),
        on_route=float(np.mean(is_routed[whom])),
    )


def _mean(teammates: Float[np.ndarray, "M 3"]) -> Teammate:
    """Return the mean of several teammates, a row each in the order of the fields."""
    return Teammate(*np.mean(teammates, axis=0).tolist())


def rows(settings: Settings) -> Iterator[RouteRow]:
    """Fly every policy at every range ratio; yield the means."""
    seeds = range(settings.seed, settings.seed + settings.num_missions)
    for policy in POLICIES:
        for ratio in settings.ratios:
            mission = paper(
                "stationary",
                num_robots=settings.num_robots,
                num_windows=settings.num_windows,
                range_ratio=ratio,
            )
            found: list[Addressed] = []
            whole = settings.num_missions * mission.num_windows
            with WorkBar(f"{policy} at {ratio:g}", whole, "windows") as bar:
                for first in range(0, len(seeds), BATCH):
                    found += addressed(mission, policy, seeds[first : first + BATCH], bar)
            yield _row(policy, ratio, found, settings)


def _row(policy: str, ratio: float, found: Sequence[Addressed], settings: Settings) -> RouteRow:
    """Return the means over missions; raise ValueError if nobody addressed anybody."""
    if len(found) < 2:
        raise ValueError(
            f"{policy} addressed known teammates in {len(found)} missions at range ratio "
            f"{ratio:g}, and a mean needs 2; fly more missions, or more windows"
        )
    chosen = np.array([each.chosen for each in found])
    mean = _mean(chosen)
    sem = Teammate(*(np.std(chosen, axis=0, ddof=1) / math.sqrt(len(found))).tolist())
    drawn = _mean(np.array([each.drawn for each in found]))
    return RouteRow(
        policy=policy,
        range_ratio=ratio,
        requests_per_window=float(np.mean([each.requests_per_window for each in found])),
        apart_ranges_mean=mean.apart_ranges,
        apart_ranges_sem=sem.apart_ranges,
        drawn_apart_ranges_mean=drawn.apart_ranges,
        near_mean=mean.near,
        near_sem=sem.near,
        drawn_near_mean=drawn.near,
        on_route_mean=mean.on_route,
        on_route_sem=sem.on_route,
        drawn_on_route_mean=drawn.on_route,
        episodes=settings.num_missions,
        seed=settings.seed,
        commit=commit(),
    )


def run(settings: Settings) -> int:
    """Run the experiment; return its exit code."""
    check_outputs(Output("table of routes", settings.out, ".csv"))
    found = list(rows(settings))
    table = Table(title="Whom robots address, and whom a draw would")
    for heading in ("policy", "range ratio", "distance [ranges]", "near", "on a route"):
        table.add_column(heading)
    for row in found:
        table.add_row(
            row.policy,
            f"{row.range_ratio:g}",
            f"{row.apart_ranges_mean:.2f} ({row.drawn_apart_ranges_mean:.2f})",
            f"{row.near_mean:.0%} ({row.drawn_near_mean:.0%})",
            f"{row.on_route_mean:.0%} ({row.drawn_on_route_mean:.0%})",
        )
    Console(highlight=False).print(table)
    write_csv(
        settings.out, [spec.name for spec in fields(RouteRow)], (asdict(row) for row in found)
    )
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; return its exit code."""
    return script(Settings, run, arguments)


if __name__ == "__main__":
    sys.exit(main())
