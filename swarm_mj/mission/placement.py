"""Draws of a mission: connected initial positions (IV-B), and robots that fail half-way.

Failures are a test of robustness, not the paper's. From then on these robots neither transmit nor
decode, and observe nothing, while they stand or move as before. No robot knows who has failed.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission.geometry import HEIGHT, PLANE, SPACE, gather_connected
from swarm_mj.mission.specification import Mission
from swarm_mj.system.compiled import compiled

MAX_DRAWS = 20_000  # the sparsest of the paper's teams (range ratio 0.2) connects in a few hundred
MAX_FREE_DRAWS = 1000  # for one robot; in an area that is half free it needs two on average
MAX_ROBOTS_DRAWN = 2_000_000  # bounds the draws of large teams, whose test takes longer

# Answers a question about each robot of a team at these positions [m].
Test = Callable[[Float[np.ndarray, "N D"]], Bool[np.ndarray, "N"]]


@compiled()
def largest_part(position_m: Float[np.ndarray, "N D"], range_m: float) -> Bool[np.ndarray, "N"]:
    """Return who is in the largest connected part of the disk graph.

    That is everyone if its algebraic connectivity (Fiedler 1973), which the paper tests (IV-B), is
    positive.
    """
    num_robots = len(position_m)
    num_most = 0
    is_met = np.zeros(num_robots, dtype=np.bool_)
    members = np.empty(num_robots, dtype=np.int64)
    part = np.zeros(num_robots, dtype=np.bool_)
    for first in range(num_robots):
        if not is_met[first]:
            num_members = gather_connected(position_m, range_m, first, is_met, members)
            if num_members > num_most:
                num_most = num_members
                part[:] = False
                for n in range(num_members):
                    part[members[n]] = True
    return part


def connected_positions(
    num_robots: int,
    half_side_m: float,
    range_m: float,
    rng: np.random.Generator,
    largest_part_at: Test | None = None,
    is_blocked_at: Test | None = None,
    *,
    keeps_largest: bool = False,
    height_m: Float[np.ndarray, "N"] | None = None,
) -> Float[np.ndarray, "N D"]:
    """Return positions uniform in the area at which the team is connected [m] (IV-B).

    Args:
        num_robots: N.
        half_side_m: Positions lie within plus or minus this, along x and y [m].
        range_m: Of the disk graph, which must be connected [m].
        rng: Draws the positions.
        largest_part_at: Says who is in the largest connected part under the team's own channel;
            None is the disk graph's.
        is_blocked_at: Says who cannot be there, and is drawn anew; None: all can.
        keeps_largest: Whether only robots outside the largest part are drawn anew, not the whole
            team: between obstacles, or of thousands, hardly any team is connected that is drawn at
            once.
        height_m: Of each robot, [N], [m]; then positions have three axes.

    Raises:
        ValueError: All draws were disconnected, or the area has hardly any free space.
    """
    num_draws = min(MAX_DRAWS, MAX_ROBOTS_DRAWN // num_robots)
    position_m = np.empty((num_robots, PLANE if height_m is None else SPACE))
    if height_m is not None:
        position_m[:, HEIGHT] = height_m
    is_kept = np.zeros(num_robots, dtype=np.bool_)
    find = largest_part_at or partial(largest_part, range_m=range_m)
    for _ in range(num_draws):
        _draw_free(position_m, is_kept, half_side_m, rng, is_blocked_at)
        part = find(position_m)
        if np.all(part):
            return position_m
        if keeps_largest:
            is_kept = part
    reach = f"a range of {range_m:g} m"
    if largest_part_at is not None:
        reach += " in free space, which this channel changes,"
    raise ValueError(
        f"no connected team in {num_draws} draws: {num_robots} robots with {reach} are too sparse "
        f"for {_area(half_side_m)}; raise the range ratio or the density"
    )


def _draw_free(
    position_m: Float[np.ndarray, "N D"],
    is_kept: Bool[np.ndarray, "N"],
    half_side_m: float,
    rng: np.random.Generator,
    is_blocked_at: Test | None,
) -> None:
    """Draw where all others stand, and those anew that cannot be there, until all can."""
    is_due = ~is_kept
    for _ in range(MAX_FREE_DRAWS):
        fresh = rng.uniform(-half_side_m, half_side_m, size=(int(np.sum(is_due)), PLANE))
        position_m[is_due, :PLANE] = fresh
        if is_blocked_at is None or not np.any(is_due := is_blocked_at(position_m)):
            return
    raise ValueError(
        f"{int(np.sum(is_due))} of {len(position_m)} robots found no free space in "
        f"{MAX_FREE_DRAWS} draws over {_area(half_side_m)}; choose an arena that leaves more room, "
        "or fewer robots"
    )


def _area(half_side_m: float) -> str:
    return f"an area of {2 * half_side_m:.0f} m by {2 * half_side_m:.0f} m"


def draw_survivors(
    mission: Mission, rngs: Sequence[np.random.Generator]
) -> Bool[np.ndarray, "B N"] | None:
    """Return who is active in the second half, as many in each mission; None if nobody fails."""
    if mission.num_failures == 0:
        return None
    is_active = np.ones((len(rngs), mission.num_robots), dtype=np.bool_)
    for b, rng in enumerate(rngs):
        is_active[b, rng.choice(mission.num_robots, mission.num_failures, replace=False)] = False
    return is_active
