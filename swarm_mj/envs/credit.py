"""A robot's own credit: what a window's gain would have lost had the robot stayed silent.

The difference reward of Wolpert and Tumer (2001): the window is replayed without the robot, through
the same channel and by the same protocol. Its sum has the gradient of the team's gain, and a silent
robot's credit is 0.
"""

import copy
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission.batched_rng import Started
from swarm_mj.protocol.checks import checked_decode
from swarm_mj.protocol.timestamps import merge_timestamps, observe_own
from swarm_mj.protocol.window import SLOT_WINDOWS, Phase, channel_at, of_active, respondents
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel
from swarm_mj.system.compiled import compiled

Kind = TypeVar("Kind", bound=Channel | VaryingChannel)


def credits_of(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N 2"],
    recipient: Int[np.ndarray, "B N"],
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "B"],
    is_active: Bool[np.ndarray, "B N"] | None = None,
) -> Float[np.ndarray, "B N"]:
    """Return the age that the team would not have lost in a window without each robot.

    A channel that is not the package's meets B missions at a time, as it does in flight.

    Args:
        timestamp: T at the end of the window before [windows].
        position_m: Where the robots are in this window [m].
        recipient: Whom each robot addresses; itself is silence.
        channel: Who decodes whom; a `snapshot_channel` from before the window, as channels may
            draw or remember.
        now: t at the start of the window [windows].
        is_active: Who took part in the window, and whose age counts; None is everyone.

    Returns:
        The credit of every robot, summed over pairs of robots [windows]; it may be negative.
    """
    if is_active is not None:
        recipient = of_active(is_active, recipient)
        # Nobody can gain by news of a robot that has failed: it is not counted in the age.
        timestamp = np.where(is_active[:, None, :], timestamp, np.inf)
    mission, sender = np.nonzero(recipient != np.arange(recipient.shape[1]))
    alone = recipient[mission]  # one row per sender: everyone's recipients without it
    alone[np.arange(sender.size), sender] = sender
    rows = np.concatenate([np.arange(len(now)), mission])
    if not isinstance(channel, (FreeSpaceRadio, VaryingChannel)):
        channel = _Rows(channel, rows)
    sent_to = np.concatenate([recipient, alone])
    took_part = None if is_active is None else is_active[rows]
    gained = gain(timestamp, position_m[rows], sent_to, channel, now[rows], rows, took_part)
    credit = np.zeros(recipient.shape)
    credit[mission, sender] = gained[mission] - gained[len(now) :]
    return credit


def snapshot_channel(channel: Kind) -> Kind:
    """Return a channel that later draws of this one do not change, to replay a window with."""
    draws = isinstance(channel, Started) and not isinstance(channel, VaryingChannel)
    return copy.deepcopy(channel) if draws else channel


class _Rows:
    """A channel of B missions for rows of windows, each as if it alone were that mission's.

    A channel that draws gives every row the numbers that the mission's own window had.
    """

    def __init__(self, channel: Channel, mission: Int[np.ndarray, "W"]) -> None:
        """Take the channel as it was before the window, and each row's mission."""
        self._mission = mission
        self._turn = np.array([np.sum(mission[:w] == b) for w, b in enumerate(mission)])
        self._channels = [snapshot_channel(channel) for _ in range(int(np.max(self._turn)) + 1)]

    def __call__(
        self, position_m: Float[np.ndarray, "W N 2"], recipient: Int[np.ndarray, "W N"]
    ) -> Int[np.ndarray, "W N"]:
        """As `Channel`; the first rows are all missions in their order."""
        heard = np.empty_like(recipient)
        num_missions = int(np.max(self._mission)) + 1
        for turn, channel in enumerate(self._channels):
            rows = np.flatnonzero(self._turn == turn)
            sent_to = np.tile(np.arange(recipient.shape[1]), (num_missions, 1))
            sent_to[self._mission[rows]] = recipient[rows]
            answered = checked_decode(channel, position_m[:num_missions], sent_to)
            heard[rows] = answered[self._mission[rows]]
        return heard


def gain(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "W N 2"],
    recipient: Int[np.ndarray, "W N"],
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "W"],
    mission: Int[np.ndarray, "W"],
    is_active: Bool[np.ndarray, "W N"] | None = None,
) -> Float[np.ndarray, "W"]:
    """How much age W windows of Alg. 1 take from what robots know about others.

    Arguments are as in `credits_of`, one row a window; `mission` says which mission's T each window
    starts from. Returns the sum over pairs of robots of what T rises by [windows].
    """
    first, second = (channel_at(channel, now + n * SLOT_WINDOWS, mission) for n in (1, 2))
    heard = of_active(is_active, first(position_m, recipient))
    answered = respondents(Phase(recipient=recipient, heard=heard))
    heard_answer = of_active(is_active, second(position_m, answered))
    gained = np.empty(len(mission))
    _replay(timestamp, mission, heard, heard_answer, now, gained)
    return gained


@compiled()
def _replay(
    timestamp: Float[np.ndarray, "B N N"],
    mission: Int[np.ndarray, "W"],
    heard: Int[np.ndarray, "W N"],
    heard_answer: Int[np.ndarray, "W N"],
    now: Float[np.ndarray, "W"],
    gained: Float[np.ndarray, "W"],
) -> None:
    """Timestamps alone, through the two slots: who merges whose packet."""
    for w in range(mission.shape[0]):
        before = timestamp[mission[w]].copy()
        observe_own(before, now[w] + SLOT_WINDOWS)
        after = before.copy()
        gained[w] = merge_timestamps(before, heard[w], after)
        observe_own(after, now[w] + 2 * SLOT_WINDOWS)
        before[...] = after
        gained[w] += merge_timestamps(before, heard_answer[w], after)
