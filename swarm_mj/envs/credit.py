"""A robot's own credit: what its team's gain would have lost had the robot stayed silent.

    D_i = sum over windows h < H of [age(without i's packet in window 0) - age(as flown)]

The difference reward D of Wolpert and Tumer (2001), where the gain is minus the age: window 0 is
replayed without the robot, through the same channel and by the same protocol. Its sum has the
gradient of the team's gain, and a silent robot's credit is 0. Replayed with a packet that a silent
robot did not send, the window tells what it would have been worth: age(as flown) - age(with it) (as
in Foerster et al., 2018, where a critic guesses it).

News matters for longer than a window: it is passed on, and who has it need not hear it again soon.
So both courses of a window may be followed through those after it, up to the horizon H, in which
everyone decodes whom it did in fact. That is an approximation: robots that knew less would have
decided otherwise.
"""

import copy
from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission.batched_rng import Started
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, merge_timestamps, observe_own
from swarm_mj.protocol.window import respondents, silence, transmit
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel
from swarm_mj.system.compiled import compiled

Kind = TypeVar("Kind", bound=Channel | VaryingChannel)
End = Literal["over", "cut"]  # cut: the mission would have gone on


class ReplayedWindow(NamedTuple):
    """A window of B missions as it was, and as it would have been had one robot acted otherwise."""

    timestamp: Float[np.ndarray, "B N N"]  # T before it [windows]
    after: Float[np.ndarray, "B N N"]  # T after it [windows]
    now: Float[np.ndarray, "B"]  # its start [windows]
    is_active: Bool[np.ndarray, "B N"]  # robots that have not failed
    # Whom each robot decodes in both slots, itself if none.
    heard: Int[np.ndarray, "B N"]
    heard_answer: Int[np.ndarray, "B N"]
    # R robots that speak or might have spoken, and whom all decode if one of them acts otherwise.
    mission: Int[np.ndarray, "R"]
    robot: Int[np.ndarray, "R"]
    spoke: Bool[np.ndarray, "R"]  # whether it spoke, and otherwise is silent, or the reverse
    otherwise_heard: Int[np.ndarray, "R N"]
    otherwise_heard_answer: Int[np.ndarray, "R N"]
    end: End | None  # of its missions, if they end with it


class Credits(NamedTuple):
    """The worth to its team of each robot's packet, sent or only considered, in S windows."""

    credit: Float[np.ndarray, "S B N"]
    is_whole: Bool[np.ndarray, "S"]  # whether all of the horizon was flown, or the mission ended


def credits_over(windows: Sequence[ReplayedWindow], horizon: int) -> Credits:
    """Return by how much the team's age would be higher without each robot's packet.

    Args:
        windows: S windows one after the other; missions may end in between, and others begin.
        horizon: Over how many windows ages are summed up, from a packet's own on. Fewer are left at
            the end of a mission, or of what was flown.

    Returns:
        The credits, summed over pairs of robots and windows [windows]; they may be negative. Of
        silence they are 0.
    """
    num_windows = len(windows)
    credit = np.zeros((num_windows, *windows[0].timestamp.shape[:2]))
    is_whole = np.zeros(num_windows, np.bool_)
    after = np.stack([window.after for window in windows])
    now = np.stack([window.now for window in windows])
    is_active = np.stack([window.is_active for window in windows])
    heard = np.stack([window.heard for window in windows])
    heard_answer = np.stack([window.heard_answer for window in windows])
    beyond = num_windows  # the first window that another mission has, or that was not flown
    is_over = False  # whether there is nothing more of the mission
    for first in reversed(range(num_windows)):
        window = windows[first]
        if window.end is not None:
            beyond = first + 1
            is_over = window.end == "over"
        stop = min(first + horizon, beyond)
        is_whole[first] = is_over or stop == first + horizon
        difference = np.zeros(len(window.robot))  # D_i, or minus D_i of packets put in
        _follow(
            timestamp=window.timestamp,
            after=after[first:stop],
            now=now[first:stop],
            is_active=is_active[first:stop],
            heard=heard[first:stop],
            heard_answer=heard_answer[first:stop],
            mission=window.mission,
            otherwise_heard=window.otherwise_heard,
            otherwise_heard_answer=window.otherwise_heard_answer,
            difference=difference,
        )
        negated = 0.0 - difference  # without the sign of -0.0
        credit[first, window.mission, window.robot] = np.where(window.spoke, difference, negated)
    return Credits(credit=credit, is_whole=is_whole)


def replay_otherwise(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N D"],
    recipient: Int[np.ndarray, "B N"],
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "B"],
    is_active: Bool[np.ndarray, "B N"] | None = None,
    considered: Int[np.ndarray, "B N"] | None = None,
    end: End | None = None,
) -> ReplayedWindow:
    """Replay a window as it was, and once for each robot that speaks or might have spoken.

    Args:
        timestamp: T at the end of the window before [windows], [B N N].
        position_m: Where the robots are, [B N D].
        recipient: Whom each robot addresses, [B N]; itself is silence.
        channel: A `snapshot_channel` from before the window.
        now: The start of the window [windows], [B].
        is_active: Robots that have not failed, [B N]; without it, all count.
        considered: Whom each robot might have addressed, [B N]: who does speak, its recipient, and
            others anyone, or themselves. Without it, `recipient`.
        end: Of the missions, if they end with it.

    Returns:
        What was heard, and what would have been.
    """
    if considered is None:
        considered = recipient
    if is_active is not None:
        recipient = recipient.copy()
        silence(recipient, is_active)
        considered = considered.copy()
        silence(considered, is_active)

    # Each packet is left out of a window that had it, or put into one that had not.
    robots = np.arange(recipient.shape[1])
    otherwise = np.where(recipient == robots, considered, robots)
    mission, robot = np.nonzero(otherwise != recipient)
    world = _World(position_m=position_m, channel=channel, now=now, is_active=is_active)
    if isinstance(channel, (FreeSpaceRadio, VaryingChannel)):
        heard, heard_answer = _decoded_at_once(world, recipient, otherwise)
    else:
        heard, heard_answer = _decoded_in_turn(world, recipient, otherwise)
    num_missions = len(recipient)
    after = timestamp.copy()
    _merge_windows(after, now, heard, heard_answer)
    return ReplayedWindow(
        timestamp=timestamp,
        after=after,
        now=now.copy(),
        is_active=np.ones(recipient.shape, np.bool_) if is_active is None else is_active.copy(),
        heard=heard[:num_missions],
        heard_answer=heard_answer[:num_missions],
        mission=mission,
        robot=robot,
        spoke=recipient[mission, robot] != robot,
        otherwise_heard=heard[num_missions:],
        otherwise_heard_answer=heard_answer[num_missions:],
        end=end,
    )


class _World(NamedTuple):
    """The places, the channel and the clock in which windows of B missions are replayed."""

    position_m: Float[np.ndarray, "B N D"]
    channel: Channel | VaryingChannel
    now: Float[np.ndarray, "B"]
    is_active: Bool[np.ndarray, "B N"] | None

    def decoded(
        self, mission: Int[np.ndarray, "W"], recipient: Int[np.ndarray, "W N"]
    ) -> tuple[Int[np.ndarray, "W N"], Int[np.ndarray, "W N"]]:
        """Return who decodes whom in both slots of W windows, each of one of the missions."""
        channel = snapshot_channel(self.channel)
        position_m = self.position_m[mission]
        is_active = None if self.is_active is None else self.is_active[mission]
        t = self.now[mission] + SLOT_WINDOWS
        request = transmit(position_m, is_active, recipient, channel, t, mission)
        t = t + SLOT_WINDOWS
        response = transmit(position_m, is_active, respondents(request), channel, t, mission)
        return request.heard, response.heard


def _decoded_at_once(
    world: _World, recipient: Int[np.ndarray, "B N"], otherwise: Int[np.ndarray, "B N"]
) -> tuple[Int[np.ndarray, "W N"], Int[np.ndarray, "W N"]]:
    """Return who decodes whom in the windows as they were, and then in those of robots, one by one.

    All of them are rows of one batch, which is ten times faster than one after the other.
    """
    mission, robot = np.nonzero(otherwise != recipient)
    others = recipient[mission]  # a row for each robot that acts otherwise
    others[np.arange(robot.size), robot] = otherwise[mission, robot]
    rows = np.concatenate([np.arange(len(recipient)), mission])
    return world.decoded(rows, np.concatenate([recipient, others]))


def _decoded_in_turn(
    world: _World, recipient: Int[np.ndarray, "B N"], otherwise: Int[np.ndarray, "B N"]
) -> tuple[Int[np.ndarray, "W N"], Int[np.ndarray, "W N"]]:
    """Replay B missions at a time: a user's channel meets them as in flight, draws included."""
    num_missions = len(recipient)
    missions = np.arange(num_missions)
    differs = otherwise != recipient
    turn = np.cumsum(differs, axis=1) * differs  # 1 for the first of a mission, and so on
    row = np.cumsum(differs).reshape(differs.shape) - 1 + num_missions
    heard = np.empty((num_missions + differs.sum(), recipient.shape[1]), np.int64)
    heard_answer = heard.copy()
    heard[:num_missions], heard_answer[:num_missions] = world.decoded(missions, recipient)
    for n in range(1, int(turn.max(initial=0)) + 1):
        its_turn = turn == n
        decoded, decoded_answer = world.decoded(missions, np.where(its_turn, otherwise, recipient))
        mission, robot = np.nonzero(its_turn)
        heard[row[mission, robot]] = decoded[mission]
        heard_answer[row[mission, robot]] = decoded_answer[mission]
    return heard, heard_answer


def snapshot_channel(channel: Kind) -> Kind:
    """Return a channel that later draws of this one do not change, to replay a window with."""
    draws = isinstance(channel, Started) and not isinstance(channel, VaryingChannel)
    return copy.deepcopy(channel) if draws else channel


@compiled()
def _merge_windows(
    timestamp: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    heard: Int[np.ndarray, "B N"],
    heard_answer: Int[np.ndarray, "B N"],
) -> None:
    """Pass T of B missions through a window, by who decodes whom in its two slots."""
    packet = np.empty(timestamp.shape[1:])
    for b in range(timestamp.shape[0]):
        _merge_slot(timestamp[b], packet, now[b] + SLOT_WINDOWS, heard[b])
        _merge_slot(timestamp[b], packet, now[b] + 2 * SLOT_WINDOWS, heard_answer[b])


@compiled()
def _merge_slot(
    timestamp: Float[np.ndarray, "N N"],
    packet: Float[np.ndarray, "N N"],
    end: float,
    heard: Int[np.ndarray, "N"],
) -> None:
    """Pass T through a slot that ends at a time; `packet` is room."""
    observe_own(timestamp, end)
    packet[...] = timestamp
    merge_timestamps(packet, heard, timestamp)


@compiled()
def _follow(
    timestamp: Float[np.ndarray, "B N N"],
    after: Float[np.ndarray, "S B N N"],
    now: Float[np.ndarray, "S B"],
    is_active: Bool[np.ndarray, "S B N"],
    heard: Int[np.ndarray, "S B N"],
    heard_answer: Int[np.ndarray, "S B N"],
    mission: Int[np.ndarray, "R"],
    otherwise_heard: Int[np.ndarray, "R N"],
    otherwise_heard_answer: Int[np.ndarray, "R N"],
    difference: Float[np.ndarray, "R"],
) -> None:
    """Follow each window that is otherwise; add up in `difference` by how much ages are higher."""
    other = np.empty(timestamp.shape[1:])
    packet = np.empty(timestamp.shape[1:])
    for r in range(len(mission)):
        b = mission[r]
        other[...] = timestamp[b]
        for n in range(len(now)):
            first = otherwise_heard[r] if n == 0 else heard[n, b]
            second = otherwise_heard_answer[r] if n == 0 else heard_answer[n, b]
            _merge_slot(other, packet, now[n, b] + SLOT_WINDOWS, first)
            _merge_slot(other, packet, now[n, b] + 2 * SLOT_WINDOWS, second)
            risen, is_same = _risen(after[n, b], other, is_active[n, b])
            difference[r] += risen
            if is_same:
                break  # and so it stays


# Added up in any order: only so loops of sums become vectors.
@compiled(fastmath={"nnan", "reassoc"}, makes_arrays=False)
def _risen(
    timestamp: Float[np.ndarray, "N N"],
    other: Float[np.ndarray, "N N"],
    is_active: Bool[np.ndarray, "N"],
) -> tuple[float, bool]:
    """Return by how much ages are higher at another T [windows], and whether it is the same T."""
    total = 0.0
    apart = 0.0
    for i in range(len(other)):
        # Robots that have failed are not counted in the age, nor is what they know.
        if not is_active[i]:
            continue
        for k in range(len(other)):
            risen = timestamp[i, k] - other[i, k]
            total += risen if is_active[k] else 0.0
            apart += abs(risen)
    return total, apart == 0.0
