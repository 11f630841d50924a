"""Checks where users' choices enter the window: the compiled loops behind them trust their input.

Index order: `[b, i]` is robot `i` of mission `b`.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.radio.free_space import Channel
from swarm_mj.system.arguments import name_of
from swarm_mj.system.compiled import compiled
from swarm_mj.system.user_code import is_ours


def checked_robots(
    what: str, robots: ArrayLike, shape: tuple[int, int], *, may_broadcast: bool = False
) -> Int[np.ndarray, "B N"]:
    """Return the robots that those of B missions chose, in the integers that compiled loops take.

    Raises ValueError, naming `what`, unless each robot has chosen one robot.
    """
    given = as_array(what, robots)
    if given.shape != shape:
        raise ValueError(f"{what} must have shape {shape}, missions by robots, not {given.shape}")
    if given.dtype.kind not in "iu":
        raise ValueError(f"{what} must be integers from 0 to {shape[1] - 1}, not {given.dtype}")
    # The same array, unless its numbers have another width or another byte order.
    chosen = given.astype(np.int64, copy=False)
    # No unsigned number is below 0, but the largest of them would become BROADCAST.
    low = BROADCAST if may_broadcast and given.dtype.kind == "i" else 0
    if not _are_between(chosen, low, shape[1]):
        b, i = np.argwhere((chosen < low) | (chosen >= shape[1]))[0]
        where = f"{what} of robot {i} in mission {b}"
        raise ValueError(f"{where} must be from 0 to {shape[1] - 1}, not {given[b, i]}")
    return chosen


def as_array(what: str, given: object) -> np.ndarray:
    """Return what was given as an array; raise ValueError for lists of different lengths."""
    try:
        return np.asarray(given)
    except ValueError as error:
        rule = f"{what} must be an array, or lists of the same length"
        raise ValueError(f"{rule}, not {given!r:.80}") from error


def checked_decode(
    channel: Channel, position_m: Float[np.ndarray, "B N D"], recipient: Int[np.ndarray, "B N"]
) -> Int[np.ndarray, "B N"]:
    """Return whose packet each robot decodes; arguments as in `Channel`.

    The package's channels are trusted, and so fast. A user's own gets copies, which it may write.
    Raises ValueError if it answered what is no robot, or a robot that is silent.
    """
    if is_ours(channel):
        return channel(position_m, recipient.copy())  # in the one layout it is compiled for
    name = name_of(channel)
    answer = np.array(channel(position_m.copy(), recipient.copy()))
    heard = checked_robots(f"channel {name}: sender heard", answer, recipient.shape)
    identity = np.arange(recipient.shape[1])
    is_silent = recipient == identity
    is_impossible = (heard != identity) & np.take_along_axis(is_silent, heard, axis=1)
    if np.any(is_impossible):
        b, j = np.argwhere(is_impossible)[0]
        raise ValueError(
            f"channel {name} let robot {j} in mission {b} decode robot {heard[b, j]}, which is "
            "silent; it may answer a robot that transmits, or the listener's own index for nobody"
        )
    return heard


@compiled()
def _are_between(numbers: Int[np.ndarray, "B N"], low: int, end: int) -> bool:
    for number in numbers.flat:  # noqa: SIM110 - no generators in loops that numba compiles
        if not low <= number < end:
            return False
    return True
