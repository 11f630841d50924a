"""Names curves where they end, so that no legend needs to be looked up."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from scipy.optimize import isotonic_regression

from swarm_mj.evaluation.figures.curves import Curve
from swarm_mj.evaluation.figures.style import look_of

LINE_IN = 0.165  # from one name to the next
MORE = "+"  # after the names of methods whose packets carry more than T, M and P
PLACE = 1.045  # of the axes' width


def name_ends(axes: Axes, curves: Sequence[Curve]) -> None:
    """Write each method's name beside the axes, as near the end of its curve as others allow.

    Args:
        axes: With their limits set.
        curves: Drawn in them, ours last; names of methods that only the paper has are slanted.
    """
    named = {curve.method: curve for curve in curves}  # ours come last
    ends = [(curve.x[-1], curve.mean[-1]) for curve in named.values()]
    fraction = axes.transAxes.inverted().transform(axes.transData.transform(ends))
    places = spread(fraction[:, 1], LINE_IN / (axes.bbox.height / axes.figure.dpi))
    for curve, end, place in zip(named.values(), ends, places, strict=True):
        look = look_of(curve.method)
        axes.annotate(
            name_of(curve),
            xy=end,
            xytext=(PLACE, place),
            textcoords="axes fraction",
            color=look.ink,
            fontsize=8,
            fontstyle="italic" if curve.is_published else "normal",
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": look.colour,
                "linestyle": "--" if curve.is_published else "-",
                "linewidth": 0.6,
                "shrinkA": 1.0,
                "shrinkB": 4.0,
                "relpos": (0.0, 0.5),
            },
        )


def name_of(curve: Curve) -> str:
    """Return a method's name, marked where its packets carry more than T, M and P."""
    label = look_of(curve.method).label
    return f"{label} {MORE}" if curve.carries_more else label


def spread(wanted: Float[np.ndarray, "L"], gap: float) -> Float[np.ndarray, "L"]:
    """Return the places nearest to those wanted, in least squares, that keep their order and a gap.

    They stand from 0 to 1, if there is room for all.
    """
    order = np.argsort(wanted, kind="stable")
    steps = gap * np.arange(len(wanted))
    base = isotonic_regression(wanted[order] - steps).x
    places = np.empty(len(wanted))
    places[order] = np.clip(base, 0.0, max(0.0, 1.0 - steps[-1])) + steps
    return places
