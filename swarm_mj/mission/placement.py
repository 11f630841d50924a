"""Initial positions (IV-B): uniform in the area, redrawn until the disk graph is connected."""

import numpy as np
from jaxtyping import Float

from swarm_mj.compiled import compiled
from swarm_mj.mission.geometry import gather_connected

MAX_DRAWS = 20_000  # the sparsest of the paper's teams (range ratio 0.2) connects in a few hundred
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
    num_robots: int, half_side_m: float, range_m: float, rng: np.random.Generator
) -> Float[np.ndarray, "N 2"]:
    """Positions uniform in the area whose disk graph is connected (IV-B).

    Args:
        num_robots: N.
        half_side_m: Positions lie within plus or minus this [m].
        range_m: Range of the disk graph [m].
        rng: Where the positions are drawn from.

    Returns:
        Positions [m].

    Raises:
        ValueError: All draws were disconnected.
    """
    num_draws = min(MAX_DRAWS, MAX_ROBOTS_DRAWN // num_robots)
    for _ in range(num_draws):
        position_m = rng.uniform(-half_side_m, half_side_m, size=(num_robots, 2))
        if is_connected(position_m, range_m):
            return position_m
    raise ValueError(
        f"no connected team in {num_draws} draws: {num_robots} robots with a range of "
        f"{range_m:g} m are too sparse for an area of {2 * half_side_m:.0f} m by "
        f"{2 * half_side_m:.0f} m; raise the range ratio or the density"
    )
