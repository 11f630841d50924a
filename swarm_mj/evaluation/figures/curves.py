"""Curves from result files, and the published ones next to them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from swarm_mj.evaluation.published import OPTIONS, Panel, ResultFigure, points
from swarm_mj.evaluation.results import Result, carries_more, config_of, statistics_of
from swarm_mj.mission import PAPERS
from swarm_mj.protocol.mission_costs import MissionCost
from swarm_mj.simulation.components import CALLED_WITH
from swarm_mj.system.fields import as_typed

# A figure compares policies, so all else is the same.
AGREED = ("episodes", "seed", "version")  # the commits stand in the caption
PERFECT = "perfect knowledge"  # the method of a curve that no radio flew
BEYOND = ("radio", *CALLED_WITH)  # columns that the paper's missions leave empty


class NoPointsError(ValueError):
    """None of the results belongs to a figure."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A cost of one method over a figure's x."""

    method: str  # a policy's name, or what the paper calls a learned one
    is_published: bool = False
    carries_more: bool = False  # than T, M and P in its packets
    is_level: bool = False  # x does not apply to the method: one value over the whole axis
    x: Float[np.ndarray, "X"]
    mean: Float[np.ndarray, "X"]
    sem: Float[np.ndarray, "X"]  # standard error of the mean; nan where it is unknown
    band: Float[np.ndarray, "2 X"] | None = None  # the means' least and greatest, of trainings


class _Place(NamedTuple):
    """A cost at one place on the axis."""

    x: float
    mean: float
    sem: float  # nan where it is unknown


def preset_of(results: Sequence[Result]) -> str:
    """Return the one preset of all results.

    Args:
        results: Rows of result files, at least one.

    Raises:
        ValueError: There are several presets, or it is none of the paper's.
    """
    first, *others = dict.fromkeys(result.preset for result in results)
    if others:
        raise ValueError(
            f"results are of the presets {' and '.join([first, *others])}; draw one at a time, "
            "from files of one preset each"
        )
    if first not in PAPERS:
        raise ValueError(
            f"the paper's figures need a preset of the paper's, {' or '.join(PAPERS)}, not "
            f"{first!r}"
        )
    return first


def results_of(figure: ResultFigure, results: Sequence[Result]) -> list[Result]:
    """Return a figure's results, in order.

    Args:
        figure: One of the paper's.
        results: Rows of result files; those of other missions than the figure's are passed over.

    Raises:
        NoPointsError: None of the results is of the figure's missions.
        ValueError: Some results differ in more than the figure's x, so that a comparison would be
            of missions rather than of policies.
    """
    preset = preset_of(results)
    regime = figure.mission(preset)
    wanted = {name: getattr(regime, name) for name in ("task", *figure.fixed)}
    found = [each for each in results if _has(each, wanted)]
    if not found:
        described = ", ".join(f"{name} {value}" for name, value in wanted.items())
        raise NoPointsError(
            f"{figure.name} has no points: none of the {len(results)} results has {described}; "
            f"make them with `{figure.command(preset)}`, or choose others with --figure"
        )
    for result in found:
        _check_comparable(figure, result, found[0])
    return found


def _has(result: Result, wanted: Mapping[str, object]) -> bool:
    """Tell whether a result has these values in its columns."""
    return all(getattr(result, name) == value for name, value in wanted.items())


def curves(figure: ResultFigure, cost: MissionCost, results: Sequence[Result]) -> list[Curve]:
    """Return the curves of a cost: the published ones, then those of the results.

    Args:
        figure: One of the paper's.
        cost: What they show, in its unit.
        results: Those of the figure, as `results_of` selects them.
    """
    return [*_published_curves(figure, cost), *_own_curves(figure, cost, results)]


def perfect_curve(figure: ResultFigure, panel: Panel, results: Sequence[Result]) -> Curve | None:
    """Return what a panel's cost would be if all robots always knew all.

    Args:
        figure: One of the paper's, which sweeps a number of the mission.
        panel: One of its panels.
        results: Those of the figure, as `results_of` selects them.

    Returns:
        A curve over the places of the published ones and of the results; None if the panel has no
        such law.
    """
    if panel.perfect is None:
        return None
    regime = figure.mission(preset_of(results))
    own = {float(getattr(result, figure.x_name)) for result in results}
    x = np.array(sorted({*figure.xs, *own}))
    missions = [replace(regime, **{figure.x_name: each}) for each in x.tolist()]
    return Curve(
        method=PERFECT,
        x=x,
        mean=np.array([panel.perfect(mission) for mission in missions]),
        sem=np.full(len(x), math.nan),
    )


def _published_curves(figure: ResultFigure, cost: MissionCost) -> list[Curve]:
    """Return the curves that the paper's figure has, a method each."""
    its_points: dict[str, list[_Place]] = {}
    for point in points():
        if point.figure == figure.published and point.cost == cost.column:
            place = _Place(x=point.x, mean=point.mean, sem=point.sem)
            its_points.setdefault(point.method, []).append(place)
    drawn = []
    for method, places in its_points.items():
        # The paper repeats a baseline's value at each receptive field, which it does not have.
        is_one_value = len({(place.mean, place.sem) for place in places}) == 1
        is_level = is_one_value and not figure.sweeps_missions
        drawn.append(_curve(method, places, is_published=True, is_level=is_level))
    return drawn


def _own_curves(figure: ResultFigure, cost: MissionCost, results: Sequence[Result]) -> list[Curve]:
    """Return the curves of the results, a method each; several trainings are one method."""
    more = {method_of(result) for result in results if carries_more(result)}
    own: dict[tuple[str, bool], list[_Place]] = {}
    for result in results:
        x = _x(figure, result)
        found = statistics_of(result, cost)
        sem = math.nan if found.sem is None else found.sem
        # A policy without a receptive field is level: the same at both ends of the axis.
        ends = (figure.xs[0], figure.xs[-1]) if x is None else (x,)
        places = own.setdefault((method_of(result), x is None), [])
        for end in ends:
            places.append(_Place(x=end, mean=found.mean, sem=sem))
    drawn = []
    for (method, is_level), places in own.items():
        drawn.append(_curve(method, places, is_level=is_level, carries_more=method in more))
    return drawn


def method_of(result: Result) -> str:
    """Return the method that a result counts for: of `NAME, seed 2`, another training, `NAME`."""
    return result.policy.partition(", seed ")[0]


def _curve(
    method: str,
    places: Sequence[_Place],
    *,
    is_level: bool,
    is_published: bool = False,
    carries_more: bool = False,
) -> Curve:
    """Return a curve of means; of several trainings at an x their mean, without its error."""
    means_at: dict[float, list[float]] = {}
    sems_at: dict[float, list[float]] = {}
    for place in sorted(places):
        means_at.setdefault(place.x, []).append(place.mean)
        sems_at.setdefault(place.x, []).append(place.sem)
    means = [np.array(each, dtype=float) for each in means_at.values()]
    low = np.array([each.min() for each in means])
    high = np.array([each.max() for each in means])
    return Curve(
        method=method,
        is_published=is_published,
        carries_more=carries_more,
        is_level=is_level,
        x=np.array(list(means_at), dtype=float),
        mean=np.array([each.mean() for each in means]),
        sem=np.array([sems[0] if len(sems) == 1 else math.nan for sems in sems_at.values()]),
        band=None if np.array_equal(low, high) else np.stack([low, high]),
    )


def _x(figure: ResultFigure, result: Result) -> float | None:
    """Return a result's place on the axis; None for a policy without a receptive field."""
    if figure.sweeps_missions:
        return float(getattr(result, figure.x_name))
    x = config_of(result).get(figure.x_name)
    return None if x is None else float(x)


def _check_comparable(figure: ResultFigure, result: Result, first: Result) -> None:
    """Raise ValueError unless a result is evaluated like the first, on the paper's missions."""
    for name in AGREED:
        ours = getattr(first, name)
        theirs = getattr(result, name)
        if ours != theirs:
            raise ValueError(
                f"{figure.name} compares results of one {name}, not {ours} "
                f"({_where(figure, first)}) and {theirs} ({_where(figure, result)}); evaluate "
                f"all alike with `{figure.command(first.preset)}`"
            )
    swept = set(OPTIONS) - set(figure.fixed)
    # The config has fields of the mission that are no columns. Where both lack one, the file is
    # older than the field, and its missions were the paper's.
    has = config_of(result) | asdict(result)
    papers = asdict(figure.mission(result.preset)) | dict.fromkeys(BEYOND)
    for name, expected in papers.items():
        if name not in swept and has.get(name, expected) != expected:
            raise ValueError(
                f"{figure.name} shows the paper's missions, in which {name} is "
                f"{as_typed(expected)}, not {has[name]} ({_where(figure, result)}); make them with "
                f"`{figure.command(result.preset)}`, or chart others with `swarm-mj evaluate "
                "--plot FILE`"
            )


def _where(figure: ResultFigure, result: Result) -> str:
    x = _x(figure, result)
    return result.policy if x is None else f"{result.policy} at {figure.x_name} {x:g}"
