"""A flight window by window: the columns of `Run.to_dataframe` and of its CSV file."""

from collections.abc import Sequence
from operator import attrgetter

import numpy as np
from jaxtyping import Float, Shaped

from swarm_mj.mission import Mission
from swarm_mj.protocol.costs import PACKET_COUNTS
from swarm_mj.protocol.mission_costs import AOI, MISSION_COSTS
from swarm_mj.replay.recorder import Log
from swarm_mj.simulation.rollout import WindowRecord


def flight_columns(
    mission: Mission, windows: Sequence[WindowRecord], log: Log | None
) -> dict[str, Float[np.ndarray, "T"]]:
    """Return a number for each window, column by column, in the order of the table.

    Args:
        mission: What was flown.
        windows: The windows flown, in order.
        log: The flight's record, which knows the worst ages; None if there is none.
    """
    window = np.arange(1.0, len(windows) + 1.0)
    columns = {"window": window, "seconds": np.round(window * mission.window_s, 9)}
    for cost in MISSION_COSTS:
        by_window: list[np.ndarray] = []
        for each in windows:
            values = cost.of_window(each.costs)
            if values is not None:
                by_window.append(values)
        if by_window:  # or else the task has no such cost
            columns[cost.column] = _course(by_window)
        if cost is AOI and log is not None:  # the mean, and beside it the worst
            columns["aoi_worst"] = log.age_max
    columns["hops"] = _course([each.hops for each in windows])
    columns["is_complete"] = _course([each.costs.is_complete for each in windows])
    packets = [each.costs.packets for each in windows]
    for name in PACKET_COUNTS:
        count_of = attrgetter(name)
        columns[f"packets_{name}"] = _course([count_of(each) for each in packets])
    return columns


def _course(by_window: Sequence[Shaped[np.ndarray, "B"]]) -> Float[np.ndarray, "T"]:
    """Return a number of the one mission over its windows, also a truth as 0 or 1."""
    return np.concatenate(by_window).astype(float)
