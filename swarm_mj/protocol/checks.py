"""Checks where users' choices enter the window: the compiled loops behind them trust their input.

Index order: `[b, i]` is robot `i` of mission `b`.
"""

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.radio.free_space import Channel
from swarm_mj.system.arguments import name_of
from swarm_mj.system.compiled import compiled
from swarm_mj.system.user_code import is_ours


def check_robots(
    what: str, robots: np.ndarray, shape: tuple[int, int], *, may_broadcast: bool = False
) -> None:
    """Raise ValueError, naming `what`, unless each robot of B missions has chosen one robot."""
    if robots.shape != shape:
        raise ValueError(f"{what} must have shape {shape}, missions by robots, not {robots.shape}")
    if robots.dtype.kind not in "iu":
        raise ValueError(f"{what} must be integers from 0 to {shape[1] - 1}, not {robots.dtype}")
    low = BROADCAST if may_broadcast else 0
    if not _are_between(robots, low, shape[1]):
        b, i = np.argwhere((robots < low) | (robots >= shape[1]))[0]
        where = f"{what} of robot {i} in mission {b}"
        raise ValueError(f"{where} must be from 0 to {shape[1] - 1}, not {robots[b, i]}")


def checked_decode(
    channel: Channel, position_m: Float[np.ndarray, "B N 2"], recipient: Int[np.ndarray, "B N"]
) -> Int[np.ndarray, "B N"]:
    """Return whose packet each robot decodes; arguments as in `Channel`.

    The package's channels are trusted, and so fast. A user's own gets copies, which it may write.
    Raises ValueError if it answered what is no robot, or a robot that is silent.
    """
    if is_ours(channel):
        return channel(position_m, recipient.copy())  # in the one layout it is compiled for
    heard = np.array(channel(position_m.copy(), recipient.copy()))
    name = name_of(channel)
    check_robots(f"channel {name}: sender heard", heard, recipient.shape)
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
