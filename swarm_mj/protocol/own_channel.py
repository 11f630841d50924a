"""What a channel may answer (Eq. 6). The paper's is trusted, and so fast; users' own are checked.

Index order: `[b, i]` is robot `i` of mission `b`.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.protocol.buffers import check_robots
from swarm_mj.radio.composed import SlotChannel
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio
from swarm_mj.system.fields import name_of


def decoded(
    channel: Channel, position_m: Float[np.ndarray, "B N 2"], recipient: Int[np.ndarray, "B N"]
) -> Int[np.ndarray, "B N"]:
    """Whose packet each robot decodes; a user's own channel gets copies, which it may write.

    Args:
        channel: Who decodes whom.
        position_m: Positions [m].
        recipient: Whom each robot addresses, or -1 for everyone; itself is silence.

    Returns:
        The sender that each robot decodes; itself is nobody.

    Raises:
        ValueError: A user's own channel answered what is no robot, or a robot that is silent.
    """
    if isinstance(channel, (FreeSpaceRadio, SlotChannel)):
        return channel(position_m, recipient.copy())  # in the one layout it is compiled for
    heard = np.asarray(channel(position_m.copy(), recipient.copy()))
    what = f"channel {name_of(channel)}: sender heard"
    check_robots(what, heard, recipient.shape)
    identity = np.arange(recipient.shape[1])
    is_silent = recipient == identity
    is_impossible = (heard != identity) & np.take_along_axis(is_silent, heard, axis=1)
    if np.any(is_impossible):
        raise ValueError(_complaint(name_of(channel), heard, is_impossible))
    return heard


def _complaint(
    name: str, heard: Int[np.ndarray, "B N"], is_impossible: Bool[np.ndarray, "B N"]
) -> str:
    b, j = np.argwhere(is_impossible)[0]
    return (
        f"channel {name} let robot {j} in mission {b} decode robot {heard[b, j]}, which is silent; "
        "it may answer a robot that transmits, or the listener's own index for nobody"
    )
