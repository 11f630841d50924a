"""Curves from result files, and the published ones beside them."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

import numpy as np
from jaxtyping import Float

from swarm_mj.evaluation.figures.contents import OPTIONS, ResultFigure
from swarm_mj.evaluation.published import points
from swarm_mj.evaluation.results import Result, carries_more
from swarm_mj.mission import PAPERS
from swarm_mj.system.reading import read_json

# A figure compares policies, so all else is the same.
AGREED = ("episodes", "seed", "version")  # the commits stand in the caption
MOST_HOPS = 1000  # a receptive field
MOST_DECISIONS = 10**12  # a training


class NoPointsError(ValueError):
    """None of the results belongs to a figure."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A cost of one method over a figure's x."""

    method: str  # a policy's name, or what the paper calls a learned one
    is_published: bool = False
    carries_more: bool = False  # than T, M and P in its packets
    is_level: bool = False  # x means nothing to the method: the same value all over the axis
    x: Float[np.ndarray, "X"]
    mean: Float[np.ndarray, "X"]
    sem: Float[np.ndarray, "X"]  # standard error of the mean; nan where it is unknown


def preset_of(results: Sequence[Result]) -> str:
    """Return the one preset of all results, one of the paper's; raises ValueError if it is not."""
    presets = list(dict.fromkeys(result.preset for result in results))
    if len(presets) > 1:
        raise ValueError(
            f"results are of the presets {' and '.join(presets)}; draw one at a time, from files "
            "of one preset each"
        )
    if presets[0] not in PAPERS:
        raise ValueError(
            f"the paper's figures need a preset of the paper's, {' or '.join(PAPERS)}, not "
            f"{presets[0]!r}"
        )
    return presets[0]


def results_of(figure: ResultFigure, results: Sequence[Result]) -> list[Result]:
    """Return the results that belong into a figure, one per policy and x, in their order.

    Args:
        figure: Whose missions count; other regimes are passed over.
        results: One or more, of one preset.

    Raises:
        ValueError: There are none, two are of the same policy and x, or they cannot be compared
            with each other or with the paper.
    """
    preset = preset_of(results)
    regime = figure.mission(preset)
    wanted = {name: getattr(regime, name) for name in ("task", *figure.fixed)}
    found = [r for r in results if all(getattr(r, n) == value for n, value in wanted.items())]
    if not found:
        described = ", ".join(f"{name} {value}" for name, value in wanted.items())
        raise NoPointsError(
            f"{figure.name} has no points: none of the {len(results)} results has {described}; "
            f"make them with `{figure.command(preset)}`, or choose others with --figure"
        )
    _check_agreed(figure, found)
    for result in found:
        _check_papers(figure, result)
    _check_unique(figure, found)
    return found


def curves(figure: ResultFigure, cost: str, results: Sequence[Result]) -> list[Curve]:
    """Return the published curves of a cost, then ours, each in the order of their rows.

    Args:
        figure: Which figure.
        cost: The panel's: aoi or velocity_variance.
        results: Those that belong into the figure.

    Raises:
        ValueError: A cost is not positive.
    """
    return _published(figure, cost) + _ours(figure, cost, results)


def budgets(results: Sequence[Result]) -> list[int]:
    """How many team decisions the policies among results were trained on that say so, ascending.

    Raises:
        ValueError: A result says anything else.
    """
    said = [(result.policy, _config(result).get("decisions")) for result in results]
    for policy, number in said:
        if number is not None and not (type(number) is int and 0 < number <= MOST_DECISIONS):
            raise ValueError(
                f"decisions of {policy} must be a number from 1 to {MOST_DECISIONS}, not "
                f"{number!r:.60}"
            )
    return sorted({number for _, number in said if number is not None})


def _ours(figure: ResultFigure, cost: str, results: Sequence[Result]) -> list[Curve]:
    rows: dict[tuple[str, bool], list[tuple[float, float, float]]] = {}
    more = {result.policy for result in results if carries_more(result)}
    for result in results:
        x = _x(figure, result)
        ends = (figure.xs[0], figure.xs[-1]) if x is None else (x,)
        its = rows.setdefault((result.policy, x is None), [])
        its.extend((end, *_mean_and_sem(figure, cost, result)) for end in ends)
    return [
        _curve(policy, its, is_level=is_level, carries_more=policy in more)
        for (policy, is_level), its in rows.items()
    ]


def _mean_and_sem(figure: ResultFigure, cost: str, result: Result) -> tuple[float, float]:
    """Return a cost and its standard error, nan where a single episode has none."""
    mean, sem = getattr(result, f"{cost}_mean"), getattr(result, f"{cost}_sem")
    if mean <= 0.0:
        raise ValueError(
            f"{cost}_mean must be above 0, not {mean:g} ({_where(figure, result)}); make it again "
            f"with `{figure.command(result.preset)}`"
        )
    return mean, math.nan if sem is None else sem


def _published(figure: ResultFigure, cost: str) -> list[Curve]:
    rows = [p for p in points() if p.figure == figure.published and p.cost == cost]
    drawn = []
    for method, its in groupby(rows, key=lambda point: point.policy or point.method):
        values = [(point.x, point.mean, point.sem) for point in its]
        is_level = not figure.sweeps_missions and len({value[1:] for value in values}) == 1
        drawn.append(_curve(method, values, is_published=True, is_level=is_level))
    return drawn


def _curve(method: str, rows: Sequence[tuple[float, float, float]], **traits: bool) -> Curve:
    """Return a curve through rows of x, mean and standard error."""
    x, mean, sem = np.array(sorted(rows), dtype=float).T
    return Curve(method=method, x=x, mean=mean, sem=sem, **traits)


def _x(figure: ResultFigure, result: Result) -> float | None:
    """Where a result stands on the axis; None for a policy without a receptive field."""
    if figure.sweeps_missions:
        return float(getattr(result, figure.x_name))
    x = _config(result).get(figure.x_name)
    if x is not None and not (isinstance(x, int | float) and 0 <= x <= MOST_HOPS):
        raise ValueError(
            f"{figure.x_name} of {result.policy} must be a number from 0 to {MOST_HOPS}, not "
            f"{x!r:.60}"
        )
    return None if x is None else float(x)


def _config(result: Result) -> dict[str, Any]:
    """What a result says it was made with; raises ValueError unless it is a JSON object."""
    try:
        return read_json(result.config, dict)
    except ValueError as error:
        raise ValueError(
            f"config of {result.policy} must be a JSON object, not {result.config!r:.60}; make "
            "the results with `swarm-mj evaluate --csv FILE`"
        ) from error


def _check_agreed(figure: ResultFigure, results: Sequence[Result]) -> None:
    """Raise ValueError, naming two that differ, unless all were evaluated in the same way."""
    first = results[0]
    for result in results:
        for name in AGREED:
            ours, theirs = getattr(first, name), getattr(result, name)
            if ours != theirs:
                raise ValueError(
                    f"{figure.name} compares results of one {name}, not {ours} "
                    f"({_where(figure, first)}) and {theirs} ({_where(figure, result)}); evaluate "
                    f"all alike with `{figure.command(first.preset)}`"
                )


def _check_papers(figure: ResultFigure, result: Result) -> None:
    """Raise ValueError unless the missions are the paper's but for x."""
    swept = set(OPTIONS) - set(figure.fixed)
    said = _config(result) | asdict(result)
    for name, expected in asdict(figure.mission(result.preset)).items():
        if name not in swept and said.get(name, expected) != expected:
            raise ValueError(
                f"{figure.name} shows the paper's missions, in which {name} is {expected}, not "
                f"{said[name]} ({_where(figure, result)}); make them with "
                f"`{figure.command(result.preset)}`"
            )


def _check_unique(figure: ResultFigure, results: Sequence[Result]) -> None:
    """Raise ValueError if a policy has two values at one x."""
    places = [(result.policy, _x(figure, result)) for result in results]
    for index, place in enumerate(places):
        if place in places[:index]:
            raise ValueError(
                f"{figure.name} has two results of {_where(figure, results[index])}; keep one"
            )


def _where(figure: ResultFigure, result: Result) -> str:
    """Return a result's policy and x, for messages."""
    x = _x(figure, result)
    return result.policy if x is None else f"{result.policy} at {figure.x_name} {x:g}"
