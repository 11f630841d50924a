"""A check that missions converge: flown until the answer is certain, or missions run out.

A mission has converged from the first window on from which a cost stays below a limit, to its end:
the velocity variance of a flock below 1 % of its first, or the cost of any task below a number.
"""

import math
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from swarm_mj.control.motion import Flocking
from swarm_mj.evaluation.batch import Batch, start_batch
from swarm_mj.evaluation.engines import Engine
from swarm_mj.evaluation.sequential import ShareBounds, share_bounds
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission
from swarm_mj.protocol.agreement import AGREED, agreed_window, settled_window
from swarm_mj.protocol.mission_costs import TASK_COST
from swarm_mj.system.fields import check, common_setting, setting
from swarm_mj.system.packages import commit, need, version
from swarm_mj.system.user_code import one_line_each

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

Verdict: TypeAlias = Literal["holds", "does not hold", "not decided"]


@dataclass(frozen=True, kw_only=True)
class Goal:
    """The claim that is checked: this share of missions converges in time, and stays converged.

    Raises:
        ValueError: A number is out of its range.
    """

    within_s: float = common_setting(
        10.0,
        "missions must have converged by then, and stay so to their end",
        label="within",
        flag="--within",
        metavar="S",
        unit="s",
        low=0.001,
        high=1e6,
    )
    share: float = common_setting(
        0.8, "how many of all missions must, as a share", low=0.001, high=0.999
    )
    below: float | None = common_setting(
        None,
        "the cost below which a mission has converged, in its controller's unit",
        low=0.0,
        high=1e12,
        shown=f"{AGREED:.0%} of a flock's first velocity variance",
    )
    unit: str | None = setting(
        None, "the unit that --below is meant in; another one is refused", metavar="UNIT"
    )
    level: float = setting(
        0.95,
        "how certain the answer must be: it is wrong with 1 minus this probability at most",
        low=0.5,
        high=0.999999,
    )

    def __post_init__(self) -> None:
        check(self)
        if self.unit is not None and self.below is None:
            raise ValueError(f"unit {self.unit} is that of below; give the number, too")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Convergence:
    """How many missions converged in time, and what that says of all: true if the claim holds.

    Attributes:
        mission: The missions' numbers.
        policy: Who transmitted when.
        config: Everything that makes these flights again, but for their seeds.
        goal: The claim.
        cost: Its cost in words, with its unit.
        seed: Of the first mission; the others follow one by one.
        window: From which on each mission had converged, [n], nan if it had not at its end.
    """

    mission: Mission
    policy: str
    config: dict[str, Any]
    goal: Goal
    cost: str
    seed: int
    window: Float[np.ndarray, "n"]

    @property
    def seconds(self) -> Float[np.ndarray, "n"]:
        """When each mission had converged [s]; nan: it had not."""
        return self.window * self.mission.window_s

    @property
    def num_missions(self) -> int:
        """How many were flown."""
        return len(self.window)

    @property
    def num_held(self) -> int:
        """How many of them had converged in time."""
        # Times are made of whole windows, whose product with 0.1 may lie a rounding above.
        return int(np.sum(self.seconds <= self.goal.within_s * (1.0 + 1e-9)))

    @property
    def found_share(self) -> float:
        """The share of missions that had."""
        return self.num_held / self.num_missions

    @cached_property
    def interval(self) -> ShareBounds:
        """The interval of the true share; it holds whenever one stops."""
        return share_bounds(self.num_held, self.num_missions, self.goal.level)

    @property
    def verdict(self) -> Verdict:
        """`holds`, `does not hold`, or `not decided` by the missions flown."""
        low, high = self.interval
        if low > self.goal.share:
            return "holds"
        if high < self.goal.share:
            return "does not hold"
        return "not decided"

    def __bool__(self) -> bool:
        """Return whether the claim holds, so that a test may assert it."""
        return self.verdict == "holds"

    def __repr__(self) -> str:
        """Return the verdict and what it stands on, in a few lines."""
        low, high = self.interval
        goal = self.goal
        window_s = self.mission.window_s
        held = self.seconds[np.isfinite(self.seconds)]
        never = self.num_missions - len(held)
        times = "none converged for good"
        if len(held):
            middle, late = np.percentile(held, [50.0, 95.0])
            times = f"median {middle:.1f} s, 95th percentile {late:.1f} s"
            if never:
                times += f"; {never} never did"
        ratio = f"{self.num_held} of {self.num_missions} missions ({self.found_share:.1%})"
        return "\n".join(
            [
                f"{self.mission.task}, {self.policy}, {self.mission.num_robots} robots, "
                f"{self.mission.num_windows * window_s:g} s from seed {self.seed}",
                f"converged:  {self.cost}, for good",
                f"claim:      at least {goal.share:.1%} of missions within {goal.within_s:g} s",
                f"found:      {ratio}; {times}",
                f"true share: {low:.1%} to {high:.1%}, at {100 * goal.level:g}% confidence",
                f"verdict:    {self.verdict}",
            ]
        )

    def plot(self) -> "Figure":
        """Draw the share of missions that had converged, over time, beside the claim.

        Returns:
            A figure of matplotlib's.

        Raises:
            ModuleNotFoundError: matplotlib is not installed.
        """
        need("matplotlib", "a chart")
        from swarm_mj.evaluation.figures.converging import draw_convergence

        return draw_convergence(self)

    def report(self) -> dict[str, Any]:
        """Return all numbers by name, as `swarm-mj check --json` writes them.

        Returns:
            The verdict, the claim, the shares, and from which window on each mission had converged.
        """
        low, high = self.interval
        windows = [None if math.isnan(each) else int(each) for each in self.window.tolist()]
        return {
            "config": self.config,
            "verdict": self.verdict,
            "within_s": self.goal.within_s,
            "share": self.goal.share,
            "level": self.goal.level,
            "cost": self.cost,
            "missions": self.num_missions,
            "converged_in_time": self.num_held,
            "found_share": self.found_share,
            "found_share_low": low,
            "found_share_high": high,
            "seed": self.seed,
            "converged_window": windows,
        }


def converging(study: Study, goal: Goal, engine: Engine) -> Generator[Convergence]:
    """Fly a study's missions until the claim is decided, or all are flown.

    Missions count in the order of their seeds, not in that in which they are done, so that the
    answer does not depend on how many fly at once.

    Args:
        study: One policy in one regime; its episodes are the most that are flown.
        goal: The claim.
        engine: What flies them.

    Yields:
        What is known after each batch of missions.

    Raises:
        ValueError: The task has no cost that could converge, its unit is another one, or missions
            are too short.
    """
    [(mission, policy)] = study.pairs
    cost = _checked_cost(study, mission, goal)
    _check_time(mission, goal)
    config = study.config(policy, mission) | {"version": version(), "commit": commit()}
    flights = [ConvergenceBatch(batch=batch, below=goal.below) for batch in study.batches]
    early: dict[int, np.ndarray] = {}  # done before others of lower seeds
    in_order: list[np.ndarray] = []
    with closing(engine.run(fly_to_convergence, flights)) as flown:
        for index, window in flown:
            early[index] = window
            while len(in_order) in early:
                in_order.append(early.pop(len(in_order)))
                found = Convergence(
                    mission=mission,
                    policy=policy,
                    config=config,
                    goal=goal,
                    cost=cost,
                    seed=study.seed,
                    window=np.concatenate(in_order),
                )
                yield found
                if found.verdict != "not decided":
                    return


@dataclass(frozen=True, kw_only=True)
class ConvergenceBatch:
    """A batch of missions, and the cost below which each has converged."""

    batch: Batch
    below: float | None  # the task's cost; None: a flock, by its velocity variance


@one_line_each()  # what is raised loses its places on the way between processes
def fly_to_convergence(work: ConvergenceBatch) -> Float[np.ndarray, "B"]:
    """Fly a batch; return the first windows from which on its missions had converged, or nan."""
    _, flown = start_batch(work.batch)
    course: list[np.ndarray] = []
    for window in flown:
        cost = window.costs.velocity_variance_m2ps2
        if work.below is not None:
            cost = TASK_COST.of_window(window.costs)
            assert cost is not None, "missions were found to have a cost"
        course.append(cost)
    if work.below is None:
        return agreed_window(np.stack(course))
    return settled_window(np.stack(course), work.below)


def _check_time(mission: Mission, goal: Goal) -> None:
    """Raise ValueError if missions end before they are to have converged."""
    flown_s = mission.num_windows * mission.window_s
    if goal.within_s > flown_s:
        needed = math.ceil(goal.within_s / mission.window_s)
        raise ValueError(
            f"within {goal.within_s:g} s is after the missions' end at {flown_s:g} s; fly at least "
            f"{needed} windows, or choose an earlier time"
        )


def _checked_cost(study: Study, mission: Mission, goal: Goal) -> str:
    """Return the cost that has to converge, in words; raise ValueError if there is none."""
    cost = study.task_cost(mission)
    if goal.below is None:
        if mission.flocks and (cost is None or cost.name == Flocking.cost_name):
            return f"under {AGREED:.0%} of the first velocity variance"
        what = f"{cost.name} [{cost.unit}]" if cost else "no cost"
        way_out = "say below which number of it" if cost else "check flocking, or name a controller"
        raise ValueError(f"{mission.task} has {what}, so nothing says when it converged; {way_out}")
    if cost is None:
        raise ValueError(
            f"below {goal.below:g} is of a task's cost, and {mission.task} has none; name a "
            "controller with a cost, or check flocking"
        )
    if goal.unit not in (None, cost.unit):
        raise ValueError(
            f"{cost.name} is in {cost.unit}, not {goal.unit}; give the number in {cost.unit}"
        )
    return f"{cost.name} below {goal.below:g} {cost.unit}"
