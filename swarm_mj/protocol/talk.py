"""Which implementation of a window robots talk by: one choice, made when a swarm starts."""

from functools import partial

from swarm_mj.protocol import asynchronous_window, compiled_window, window
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.partial_buffers import PartialBuffers
from swarm_mj.protocol.window_protocols import Talk
from swarm_mj.radio.asynchronous import AsynchronousChannel
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel


def talk_over(channel: Channel | VaryingChannel, buffers: Buffers) -> Talk:
    """Return how robots with such buffers talk over a channel.

    Args:
        channel: Who decodes whom; the windows are played over this one.
        buffers: Buffers of the kind that will be written; only their type counts.

    Returns:
        The window of `protocol.window`, or one of the two that stand beside it.
    """
    # Packets that arrive late carry older entries, so merging and observing change places.
    if isinstance(channel, AsynchronousChannel):
        under_way = asynchronous_window.UnderWay()
        late = {"channel": channel, "under_way": under_way}
        return Talk(
            window=partial(asynchronous_window.window, **late),
            broadcast=partial(asynchronous_window.broadcast, **late),
        )
    # The paper's missions: in one compiled call a window takes a third of the time. A subclass of
    # its radio may decode otherwise, and where only some entries fit someone must choose them.
    if type(channel) is FreeSpaceRadio and not isinstance(buffers, PartialBuffers):
        return Talk(
            window=partial(compiled_window.window, channel=channel),
            broadcast=partial(compiled_window.broadcast, channel=channel),
        )
    return Talk(
        window=partial(window.window, channel=channel),
        broadcast=partial(window.broadcast, channel=channel),
    )
