"""A robot's own credit: what a window's gain would have lost had the robot stayed silent.

The difference reward of Wolpert and Tumer (2001): the window is replayed without the robot, through
the same channel and by the same protocol. Its sum has the gradient of the team's gain, and a silent
robot's credit is 0.
"""

import copy
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission.batched_rng import Started
from swarm_mj.protocol.checks import checked_decode
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, merge_timestamps, observe_own
from swarm_mj.protocol.window import Phase, channel_at, respondents, silence
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel
from swarm_mj.system.compiled import compiled

Kind = TypeVar("Kind", bound=Channel | VaryingChannel)
Replay = Callable[[np.ndarray, np.ndarray], np.ndarray]  # missions and recipients; gains


def credits_of(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N 2"],
    recipient: Int[np.ndarray, "B N"],
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "B"],
    is_active: Bool[np.ndarray, "B N"] | None = None,
) -> Float[np.ndarray, "B N"]:
    """Return the age that the team would not have lost in a window without each robot.

    T is that at the end of the window before, `now` the start of this one [windows]. The channel is
    a `snapshot_channel` from before the window. Active robots, or all, count. A credit is
    summed over pairs of robots [windows], and may be negative.
    """
    if is_active is not None:
        recipient = recipient.copy()
        silence(recipient, is_active)
        # Nothing is gained by news of a robot that has failed: it is not counted in the age.
        timestamp = np.where(is_active[:, None, :], timestamp, np.inf)

    # Without shapes: they would be made anew in every window, which takes as long as the replay.
    def replayed(rows: np.ndarray, recipient: np.ndarray) -> np.ndarray:
        """Return the gains of the windows of these missions with other recipients [windows]."""
        fresh = snapshot_channel(channel)
        its = None if is_active is None else is_active[rows]
        return gain(
            timestamp=timestamp,
            position_m=position_m[rows],
            recipient=recipient,
            channel=fresh,
            now=now[rows],
            mission=rows,
            is_active=its,
        )

    at_once = isinstance(channel, (FreeSpaceRadio, VaryingChannel))
    if at_once:
        return _credits_at_once(recipient, replayed)
    return _credits_in_turn(recipient, replayed)


def _credits_at_once(
    recipient: Int[np.ndarray, "B N"], replayed: Replay
) -> Float[np.ndarray, "B N"]:
    """Replay all windows as rows of one batch: ten times faster than one by one."""
    num_missions, num_robots = recipient.shape
    mission, sender = np.nonzero(recipient != np.arange(num_robots))
    without = recipient[mission]  # one row per sender: everyone's recipients without it
    without[np.arange(sender.size), sender] = sender
    rows = np.concatenate([np.arange(num_missions), mission])  # the windows as they were come first
    gained = replayed(rows, np.concatenate([recipient, without]))
    credit = np.zeros(recipient.shape)
    credit[mission, sender] = gained[mission] - gained[num_missions:]
    return credit


def _credits_in_turn(
    recipient: Int[np.ndarray, "B N"], replayed: Replay
) -> Float[np.ndarray, "B N"]:
    """Replay B missions at a time: a user's channel meets them as in flight, draws included."""
    num_missions, num_robots = recipient.shape
    robots = np.arange(num_robots)
    missions = np.arange(num_missions)
    together = replayed(missions, recipient)
    sends = recipient != robots
    credit = np.zeros(recipient.shape)
    turn = np.cumsum(sends, axis=1) * sends  # 1 for the first sender of a mission, and so on
    for n in range(1, int(turn.max(initial=0)) + 1):
        gained = replayed(missions, np.where(turn == n, robots, recipient))
        credit += np.where(turn == n, (together - gained)[:, None], 0.0)
    return credit


def snapshot_channel(channel: Kind) -> Kind:
    """Return a channel that later draws of this one do not change, to replay a window with."""
    draws = isinstance(channel, Started) and not isinstance(channel, VaryingChannel)
    return copy.deepcopy(channel) if draws else channel


def gain(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "W N 2"],
    recipient: Int[np.ndarray, "W N"],
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "W"],
    mission: Int[np.ndarray, "W"],
    is_active: Bool[np.ndarray, "W N"] | None = None,
) -> Float[np.ndarray, "W"]:
    """Return the age that W windows of Alg. 1 take from the team, summed over pairs [windows].

    Arguments are as in `credits_of`, one row a window; `mission` is that of the T it starts from.
    """
    first = channel_at(channel, now + SLOT_WINDOWS, mission)
    second = channel_at(channel, now + 2 * SLOT_WINDOWS, mission)
    heard = checked_decode(first, position_m, recipient)
    silence(heard, is_active)
    answered = respondents(Phase(recipient=recipient, heard=heard))
    heard_answer = checked_decode(second, position_m, answered)
    silence(heard_answer, is_active)
    gained = np.empty(len(mission))
    _replay(
        timestamp=timestamp,
        mission=mission,
        heard=heard,
        heard_answer=heard_answer,
        now=now,
        gained=gained,
    )
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
    """Pass timestamps alone through the two slots, by who decoded whose packet."""
    for w in range(mission.shape[0]):
        before = timestamp[mission[w]].copy()
        observe_own(before, now[w] + SLOT_WINDOWS)
        after = before.copy()
        gained[w] = merge_timestamps(before, heard[w], after)
        observe_own(after, now[w] + 2 * SLOT_WINDOWS)
        before[...] = after
        gained[w] += merge_timestamps(before, heard_answer[w], after)
