"""The contents of a picture of a running swarm."""

from dataclasses import replace

import numpy as np

from swarm_mj.replay.footage import Contents, Facts, Footage, frame
from swarm_mj.replay.mismatch import radio_snapshot
from swarm_mj.replay.packets import PacketSegments, fates, packet_segments
from swarm_mj.simulation.swarm import Swarm


def contents_of(
    swarm: Swarm,
    index: int = 0,
    *,
    observer: int = 0,
    full_scale: float | None = None,
) -> Contents:
    """Return what one of a swarm's missions looks like now, with the window just flown.

    Args:
        swarm: The missions.
        index: The mission.
        observer: The robot by whose knowledge the others are coloured; it is white itself.
        full_scale: The age from which robots are darkest [windows]; unless given, the number of
            robots: a round in which everyone has its turn.

    Raises:
        ValueError: There is no such mission or robot.
    """
    mission, states, buffers = swarm.mission, swarm.states, swarm.buffers
    num = mission.num_robots
    for what, value, end in (("index", index, len(swarm.now)), ("observer", observer, num)):
        if not 0 <= value < end:
            raise ValueError(f"{what} must be from 0 to {end - 1}, not {value}")
    # A copy: the swarm writes its arrays in place, and the picture may be drawn later.
    position_m = states.position_m[index].copy()
    is_on = np.ones(num, bool) if states.is_active is None else states.is_active[index]
    age = swarm.now[index] - buffers.timestamp[index, observer]
    seen = radio_snapshot(swarm, index)
    is_apart = np.zeros(num, bool) if seen is None else seen.group != seen.group[observer]
    footage = Footage(
        facts=Facts(
            mission=mission,
            policy="",
            seed=0,
            observer=observer,
            is_broadcast=swarm.is_broadcast,
            full_scale=full_scale or float(num),
        ),
        window=np.array([1]),
        position_m=position_m[None],
        velocity_mps=states.velocity_mps[[index]],
        age=np.where(buffers.is_known[index, observer], age, np.nan)[None],
        is_on=is_on[None],
        segments=_last_packets(swarm, index),
        age_mean=np.zeros(1),
        is_cut_off=(is_on & is_on[observer] & is_apart)[None],
        mismatch=None if seen is None else seen.mismatch,
    )
    # As wide wherever the team is: a live picture does not know where it will fly.
    square = frame(footage.position_m, mission.half_side_m)
    reach_m = max(mission.half_side_m, square.reach_m)
    return replace(footage.contents(0), centre_m=square.centre_m[0], reach_m=reach_m)


def _last_packets(swarm: Swarm, index: int) -> dict[str, PacketSegments]:
    """Return the packets of one mission's last window; before the first one there are none."""
    if not swarm.phases:
        return {}
    recipient = np.stack([[phase.recipient[index] for phase in swarm.phases]])
    heard = np.stack([[phase.heard[index] for phase in swarm.phases]])
    packets = fates(recipient, heard, is_broadcast=swarm.is_broadcast)
    return packet_segments(packets, swarm.states.position_m[[index]])
