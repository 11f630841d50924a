"""Initial positions (IV-B): uniform in the area, redrawn until the team is connected."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.compiled import compiled
from swarm_mj.mission.geometry import gather_connected

MAX_DRAWS = 20_000  # the sparsest of the paper's teams (range ratio 0.2) connects in a few hundred
MAX_FREE_DRAWS = 1000  # of a robot; of an area that is half free, a robot needs two
MAX_ROBOTS_DRAWN = 2_000_000  # bounds the draws of large teams, whose test takes longer


@compiled()
def is_connected(position_m: Float[np.ndarray, "N 2"], range_m: float) -> bool:
    """Whether the disk graph is connected.

    Equivalent to a positive algebraic connectivity (Fiedler 1973), which the paper tests (IV-B).

    Args:
        position_m: Positions [m].
        range_m: Two robots at most this far apart are neighbours [m].

    Returns:
        Whether every robot reaches every other over neighbours.
    """
    num_robots = len(position_m)
    is_met, members = np.zeros(num_robots, dtype=np.bool_), np.empty(num_robots, dtype=np.int64)
    return gather_connected(position_m, range_m, 0, is_met, members) == num_robots


def connected_positions(
    num_robots: int,
    half_side_m: float,
    range_m: float,
    rng: np.random.Generator,
    is_connected_at: Callable[[Float[np.ndarray, "N 2"]], bool] | None = None,
    is_blocked_at: Callable[[Float[np.ndarray, "N 2"]], Bool[np.ndarray, "N"]] | None = None,
) -> Float[np.ndarray, "N 2"]:
    """Positions uniform in the area at which the team is connected (IV-B).

    Args:
        num_robots: N.
        half_side_m: Positions lie within plus or minus this [m].
        range_m: Range of the disk graph [m].
        rng: Where the positions are drawn from.
        is_connected_at: Whether a team at these positions [m] is connected in its own channel;
            None asks whether the disk graph is.
        is_blocked_at: Which robots at these positions [m] touch an obstacle; those are drawn anew.

    Returns:
        Positions [m].

    Raises:
        ValueError: All draws were disconnected, or the area has hardly any free space.
    """
    num_draws = min(MAX_DRAWS, MAX_ROBOTS_DRAWN // num_robots)
    for _ in range(num_draws):
        position_m = rng.uniform(-half_side_m, half_side_m, size=(num_robots, 2))
        if is_blocked_at is not None:
            _draw_free(position_m, half_side_m, rng, is_blocked_at)
        if is_connected_at is None:
            if is_connected(position_m, range_m):
                return position_m
        elif is_connected_at(position_m):
            return position_m
    reach = f"a range of {range_m:g} m"
    if is_connected_at is not None:
        reach += " in free space, and less in their channel,"
    raise ValueError(
        f"no connected team in {num_draws} draws: {num_robots} robots with {reach} "
        f"are too sparse for an area of {2 * half_side_m:.0f} m by "
        f"{2 * half_side_m:.0f} m; raise the range ratio or the density"
    )


def _draw_free(
    position_m: Float[np.ndarray, "N 2"],
    half_side_m: float,
    rng: np.random.Generator,
    is_blocked_at: Callable[[Float[np.ndarray, "N 2"]], Bool[np.ndarray, "N"]],
) -> None:
    """Draws those robots anew that touch an obstacle, until none does."""
    for _ in range(MAX_FREE_DRAWS):
        is_blocked = is_blocked_at(position_m)
        if not np.any(is_blocked):
            return
        fresh_m = rng.uniform(-half_side_m, half_side_m, size=(int(np.sum(is_blocked)), 2))
        position_m[is_blocked] = fresh_m
    num_blocked = int(np.sum(is_blocked_at(position_m)))
    raise ValueError(
        f"{num_blocked} of {len(position_m)} robots found no free space in {MAX_FREE_DRAWS} draws; "
        "choose an arena with more room between its obstacles"
    )
