"""Looks at the channel: links on which the world and what policies believe differ, and groups.

Policies reckon with mean powers: a lone packet decodes if its mean power is above the threshold.
What fades and losses do to single packets is no surprise to those who know this much.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int, Int16

from swarm_mj.radio.composed import ComposedChannel, reached_from
from swarm_mj.radio.mission_radio import by_robot, radio_of
from swarm_mj.simulation.swarm import Swarm

EVERY = 5  # windows between looks; in between, the last one is shown
WAY_SHARE = 0.005  # of the area's side, that robots may fly from look to look


@dataclass(frozen=True, kw_only=True)
class Surprises:
    """L links on which world and belief differ; one for both directions if both do.

    They are believed in but too weak to decode, or they decode although nobody believes in them.
    """

    row: Int[np.ndarray, "L"]  # the look, from 0, ascending
    sender: Int16[np.ndarray, "L"]
    receiver: Int16[np.ndarray, "L"]
    is_too_weak: Bool[np.ndarray, "L"]
    loss_db: Int16[np.ndarray, "L"]  # between the two antennas [dB]
    margin_db: Int16[np.ndarray, "L"]  # of the mean power over what decodes [dB]

    @property
    def by_kind(self) -> dict[str, "Surprises"]:
        """Links that are believed in but too weak, and those that decode all the same."""
        return {
            "unbelieved": self.chosen(~self.is_too_weak),
            "too_weak": self.chosen(self.is_too_weak),
        }

    @property
    def num_bytes(self) -> int:
        """What they take of memory."""
        return sum(each.nbytes for each in vars(self).values())

    def chosen(self, which: Bool[np.ndarray, "L"] | Int[np.ndarray, "K"] | slice) -> "Surprises":
        """Some of them."""
        return Surprises(**{spec.name: getattr(self, spec.name)[which] for spec in fields(self)})


@dataclass(frozen=True, kw_only=True)
class Look:
    """What there is to see at one moment of one mission."""

    group: Int16[np.ndarray, "N"]  # the first of the robots that each is connected with
    surprises: Surprises
    num_believed: int  # links that are believed in, one for both directions
    num_working: int  # and that decode


@dataclass(frozen=True, kw_only=True)
class Looks:
    """C looks; each stands for the windows until the next one."""

    window: Int[np.ndarray, "C"]  # 1 is the mission's first window
    surprises: Surprises

    def at(self, window: int) -> Surprises:
        """What the look saw that stands for a window."""
        look = np.searchsorted(self.window, window, side="right") - 1
        first, last = np.searchsorted(self.surprises.row, [look, look + 1])
        return self.surprises.chosen(np.s_[first:last])


NO_SURPRISES = Surprises(
    row=np.zeros(0, dtype=int),
    is_too_weak=np.zeros(0, dtype=bool),
    **dict.fromkeys(("sender", "receiver", "loss_db", "margin_db"), np.zeros(0, dtype=np.int16)),
)


def stride_of(swarm: Swarm, least: int = 1) -> int:
    """Windows from look to look: so few that robots hardly move, at least so many."""
    mission = swarm.mission
    way_m = mission.max_velocity_mps * mission.window_s
    return max(1, least, min(EVERY, int(WAY_SHARE * mission.side_m / way_m)))


def look(swarm: Swarm, index: int = 0) -> Look | None:
    """What one mission's channel grants now, beside what is believed of it.

    Args:
        swarm: The missions.
        index: Which of them.

    Returns:
        The look; None in free space, where the belief is right, and in a channel of the user's own,
        which does not tell its powers.
    """
    channel = swarm.channel
    if not isinstance(channel, ComposedChannel):
        return None
    mission, position_m = swarm.mission, swarm.states.position_m[index]
    true_mw = channel.mean_powers_mw(position_m, index)
    believed_mw = swarm.belief.links(position_m).received_mw
    least_mw = channel.reception.noise_mw * channel.reception.threshold
    is_on = swarm.states.is_active
    here = np.ones(mission.num_robots, dtype=bool) if is_on is None else is_on[index]
    both = here[:, None] & here
    is_true, is_believed = (both & (power >= least_mw) for power in (true_mw, believed_mw))
    sent_mw = by_robot(mission, radio_of(mission).power_mw)
    return Look(
        group=groups(is_true),
        surprises=_surprises(is_true, is_believed, true_mw, sent_mw, least_mw),
        num_believed=_num_links(is_believed),
        num_working=_num_links(is_true),
    )


def _num_links(is_linked: Bool[np.ndarray, "N N"]) -> int:
    np.fill_diagonal(is_linked, val=False)
    return int(np.sum(np.triu(is_linked | is_linked.T)))


def groups(is_linked: Bool[np.ndarray, "N N"]) -> Int16[np.ndarray, "N"]:
    """The first of the robots that each reaches and is reached from over links, row to column."""
    group = np.full(len(is_linked), -1, dtype=np.int16)
    turned = np.ascontiguousarray(is_linked.T)
    for i in range(len(group)):
        if group[i] < 0:
            group[reached_from(is_linked, i) & reached_from(turned, i)] = i
    return group


def joined(each: Sequence[Surprises], window: Int[np.ndarray, "C"]) -> Looks:
    """What looks at these windows saw, in order."""
    row = np.repeat(np.arange(len(each)), [len(found.row) for found in each])
    return Looks(window=window, surprises=replace(_together(each), row=row))


def in_turn(kinds: Sequence[Surprises]) -> Surprises:
    """Links of several kinds, sorted by look."""
    found = _together(kinds)
    return found.chosen(np.argsort(found.row, kind="stable"))


def _together(parts: Sequence[Surprises]) -> Surprises:
    names = [spec.name for spec in fields(Surprises)]
    return Surprises(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    )


def _surprises(
    is_true: Bool[np.ndarray, "N N"],
    is_believed: Bool[np.ndarray, "N N"],
    true_mw: Float[np.ndarray, "N N"],
    sent_mw: Float[np.ndarray, "N"],
    least_mw: float,
) -> Surprises:
    differs = is_true != is_believed
    differs &= ~np.tril(differs.T)  # the other direction stands for both
    sender, receiver = np.nonzero(differs)
    power_mw = np.maximum(true_mw[sender, receiver], np.finfo(float).tiny)
    return Surprises(
        row=np.zeros(len(sender), dtype=int),
        sender=sender.astype(np.int16),
        receiver=receiver.astype(np.int16),
        is_too_weak=is_believed[sender, receiver],
        loss_db=np.round(10.0 * np.log10(sent_mw[sender] / power_mw)).astype(np.int16),
        # Downwards: what does not decode has a margin below 0.
        margin_db=np.floor(10.0 * np.log10(power_mw / least_mw)).astype(np.int16),
    )
