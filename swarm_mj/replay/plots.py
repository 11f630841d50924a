"""The replay's plots: age of information, packets, mismatched links and the task's cost."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Float, Int

from swarm_mj.replay import palette
from swarm_mj.replay.mismatch import LinkMismatch
from swarm_mj.replay.packets import PacketLinks, is_other
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.rerun_log import RerunLog

RATE_WINDOWS = 10  # that packets are counted over


class PlotCurve(NamedTuple):
    """One curve of a plot."""

    path: str  # of its entity, below "plots"
    name: str
    colour: Colour
    values: np.ndarray
    std: np.ndarray | None = None
    window: np.ndarray | None = None  # of each value; None: all of the log's
    is_hidden: bool = False  # it would dwarf the others; the viewer can show it


class Plot(NamedTuple):
    """Curves over the mission on a common axis."""

    name: str  # says what the curves are: a legend would cover them
    curves: list[PlotCurve]


def plots(log: Log, packets: dict[str, PacketLinks]) -> list[Plot]:
    """Return the plots of age, packets, mismatched links and the task's cost, as far as apply."""
    own = f"r{log.ego}"
    ages = [
        PlotCurve("age/mean", "team, mean ± std", palette.MEAN_AGE, log.age_mean, log.age_std),
        PlotCurve("age/worst", "worst pair", palette.WORST_AGE, log.age_max, is_hidden=True),
        PlotCurve("age/ego", f"{own}, mean", palette.EGO, np.mean(log.ego_age, axis=1)),
    ]
    found = [Plot(f"Age of information [windows]: team ± std (green), {own} (white)", ages)]
    found.append(_packet_plot(log, packets))
    if log.mismatch is not None:
        found.append(_mismatch_plot(log, log.mismatch))
    if (cost := log.task_cost) is not None:
        found.append(_cost_plot(cost.name, cost.unit, cost.value))
    elif log.has_motion:
        found.append(_cost_plot("velocity variance", "m²/s²", log.velocity_variance_m2ps2))
    return found


def _packet_plot(log: Log, packets: dict[str, PacketLinks]) -> Plot:
    if log.is_broadcast:
        sent, heard = broadcast_counts(log)
        counts = {"sent": (palette.SENT, sent), "heard": (palette.BROADCAST, heard)}
        named = "sent (grey), heard by anyone (blue)"
    else:
        fates = ("delivered", "lost", "overheard", "answered")
        num = len(log.window)
        counts = {
            fate: (getattr(palette, fate.upper()), np.bincount(packets[fate].row, minlength=num))
            for fate in fates
        }
        named = "delivered (green), lost (orange), answered (blue)"
    curves = [
        PlotCurve(f"radio/{name}", name, colour, rate(count), is_hidden=name == "overheard")
        for name, (colour, count) in counts.items()
    ]
    return Plot(f"Packets in {RATE_WINDOWS} windows: {named}", curves)


def broadcast_counts(log: Log) -> tuple[Int[np.ndarray, "T"], Int[np.ndarray, "T"]]:
    """Count the broadcasts sent in each window, and those that any robot decoded."""
    row, phase, hearer = np.nonzero(is_other(log.heard))
    is_heard = np.zeros(log.heard.shape, dtype=bool)
    is_heard[row, phase, log.heard[row, phase, hearer]] = True
    return np.sum(is_other(log.recipient), axis=(1, 2)), np.sum(is_heard, axis=(1, 2))


def _mismatch_plot(log: Log, mismatch: LinkMismatch) -> Plot:
    at = mismatch.window - log.window[0]
    num = {
        kind: np.bincount(links.row, minlength=len(at)) for kind, links in mismatch.by_kind.items()
    }
    none = np.zeros(len(log.window), dtype=int)
    num_believed = (none if log.num_believed is None else log.num_believed)[at]
    num_working = (none if log.num_working is None else log.num_working)[at]
    num_others, num_cut_off = np.sum(log.is_on[at], axis=1) - 1, np.sum(log.is_cut_off[at], axis=1)
    shares = {
        "believed, too weak": (palette.TOO_WEAK, num["too_weak"], num_believed),
        "works, unbelieved": (palette.UNBELIEVED, num["unbelieved"], num_working),
        f"cut off from r{log.ego}": (palette.EGO, num_cut_off, num_others),
    }
    curves = []
    for name, (colour, part, of) in shares.items():
        percent, path = 100.0 * part / np.maximum(1, of), "world/" + name.replace(" ", "_")
        curves.append(PlotCurve(path, name, colour, percent, window=mismatch.window))
    named = "believed, too weak (red); works, unbelieved (green); cut off (white)"
    return Plot(f"Share [%]: {named}", curves)


def _cost_plot(name: str, unit: str, value: Float[np.ndarray, "T"]) -> Plot:
    title = f"{name[:1].upper()}{name[1:]} [{unit}]"
    return Plot(title, [PlotCurve("task/cost", name, palette.VARIANCE, value)])


def draw_plots(out: RerunLog, shown: Sequence[Plot]) -> None:
    """Draw the curves of all plots."""
    for curve in (curve for plot in shown for curve in plot.curves):
        path, style = f"plots/{curve.path}", {"colors": [curve.colour], "names": [curve.name]}
        if curve.std is not None:
            out.fixed(path, rr.Measurements.from_fields(widths=[2.0], **style))
            columns = rr.Measurements.columns(values=curve.values, variances=curve.std**2)
        else:
            out.fixed(path, rr.SeriesLines(widths=[1.6], **style))
            columns = rr.Scalars.columns(scalars=curve.values)
        out.timed(path, columns, curve.window)


def rate(per_window: Int[np.ndarray, "T"]) -> np.ndarray:
    """Return the packets in the last `RATE_WINDOWS` windows, at each window."""
    # Over several windows, for the counts of single ones would hide the trend.
    return np.convolve(per_window, np.ones(RATE_WINDOWS))[: len(per_window)]
