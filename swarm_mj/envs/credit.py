"""A robot's own credit: what a window's gain would have lost had the robot stayed silent.

The difference reward of Wolpert and Tumer (2001): the window is replayed without the robot, through
the same channel and by the same protocol. Its sum has the gradient of the team's gain, and a silent
robot's credit is 0. Replayed with a packet that a silent robot did not send, the window tells what
it would have been worth (as in Foerster et al., 2018, where a critic guesses it).
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
    considered: Int[np.ndarray, "B N"] | None = None,
) -> Float[np.ndarray, "B N"]:
    """Return the age that the team would not have lost in a window without each robot.

    Args:
        timestamp: T at the end of the window before [windows], [B N N].
        position_m: Where the robots are, [B N 2].
        recipient: Whom each robot addresses, [B N]; itself is silence.
        channel: A `snapshot_channel` from before the window.
        now: The start of the window [windows], [B].
        is_active: Robots that have not failed, [B N]; without it, all count.
        considered: Whom each robot might have addressed, [B N]: who does speak, its recipient, and
            others anyone, or themselves. Without it, `recipient`.

    Returns:
        The credit of each robot's packet, sent or only considered, [B N], summed over pairs of
        robots [windows]; it may be negative. Of silence it is 0.
    """
    if considered is None:
        considered = recipient
    if is_active is not None:
        recipient = recipient.copy()
        silence(recipient, is_active)
        considered = considered.copy()
        silence(considered, is_active)
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
    # Each packet is left out of a window that had it, or put into one that had not.
    robots = np.arange(recipient.shape[1])
    otherwise = np.where(recipient == robots, considered, robots)
    by_windows = _lost_at_once if at_once else _lost_in_turn
    lost = by_windows(recipient, otherwise, replayed)
    return np.where(recipient == robots, 0.0 - lost, lost)


def _lost_at_once(
    recipient: Int[np.ndarray, "B N"], otherwise: Int[np.ndarray, "B N"], replayed: Replay
) -> Float[np.ndarray, "B N"]:
    """Return what windows lose if robots, one at a time, act otherwise: all as rows of one batch.

    That is ten times faster than one by one.
    """
    num_missions = len(recipient)
    mission, robot = np.nonzero(otherwise != recipient)
    others = recipient[mission]  # a row for each robot that acts otherwise
    others[np.arange(robot.size), robot] = otherwise[mission, robot]
    rows = np.concatenate([np.arange(num_missions), mission])  # the windows as they were come first
    gained = replayed(rows, np.concatenate([recipient, others]))
    lost = np.zeros(recipient.shape)
    lost[mission, robot] = gained[mission] - gained[num_missions:]
    return lost


def _lost_in_turn(
    recipient: Int[np.ndarray, "B N"], otherwise: Int[np.ndarray, "B N"], replayed: Replay
) -> Float[np.ndarray, "B N"]:
    """Replay B missions at a time: a user's channel meets them as in flight, draws included."""
    missions = np.arange(len(recipient))
    together = replayed(missions, recipient)
    differs = otherwise != recipient
    lost = np.zeros(recipient.shape)
    turn = np.cumsum(differs, axis=1) * differs  # 1 for the first of a mission, and so on
    for n in range(1, int(turn.max(initial=0)) + 1):
        gained = replayed(missions, np.where(turn == n, otherwise, recipient))
        lost += np.where(turn == n, (together - gained)[:, None], 0.0)
    return lost


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
