"""The planner's packets beyond T, M and P: two snapshots of the team, or two tables of links.

Snapshots hold N² ages, those that the last plan leads to, so packets grow with the square of the
team: 7.3 kB for 40 robots, 27 kB for 80, and 164 kB for 200. Teams at rest need no snapshots. Their
packets carry what robots observed of links, and two tables fitted to it: the one that the sender
plans by, and the best of the next.
"""

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.link_evidence import MAX_KINDS, MAX_TIMES, NUM_BINS
from swarm_mj.policies.planner.link_tables import LAWS, STEP_DB
from swarm_mj.protocol.packets import (
    POSITION_BITS,
    PacketField,
    age,
    bits_for,
    bits_per_second,
    fits,
    identity,
    least_bit_rate,
    packet_of,
    position,
    slot_bytes,
    times,
)

NUM_SENT = 2  # snapshots or tables in a packet: the current one, and the best of the next


def snapshot_fields(mission: Mission) -> tuple[PacketField, ...]:
    """Return the fields of two snapshots, as precise as T and M."""
    num_robots = mission.num_robots
    step_mps = 2.0 * mission.max_velocity_mps / 2**16
    snapshot = (
        identity("owner of the snapshot", mission),
        PacketField(name="robots known to the owner", bits=1, count=num_robots),
        # The errors of positions follow from their ages and this number.
        PacketField(name="spread of velocities", bits=16, step=step_mps, unit="m/s"),
        # 16 bits reach up to 4,096 windows.
        PacketField(
            name="expected age, of all pairs",
            bits=16,
            count=num_robots**2,
            step=1 / 16,
            unit="windows",
        ),
        times(age("age in the snapshot"), num_robots),
        times(position("position in the snapshot", mission, POSITION_BITS), num_robots),
    )
    return tuple(times(field, NUM_SENT) for field in snapshot)


def link_fields(mission: Mission) -> tuple[PacketField, ...]:
    """Return the fields of as many observations as robots may note, and of two tables of links."""
    num_robots = mission.num_robots
    num_noted = num_robots * MAX_KINDS
    num_links = NUM_SENT * num_robots * (num_robots - 1) // 2
    in_table = {"bits": 8, "count": num_links, "step": STEP_DB, "unit": "dB"}
    return (
        PacketField(name="slot since which each robot plans", bits=16, count=num_robots),
        times(identity("sender of a kind of packet", mission), num_noted),
        PacketField(name="its margin", bits=bits_for(NUM_BINS), count=num_noted),
        PacketField(name="whether it was decoded", bits=1, count=num_noted),
        PacketField(name="how often", bits=bits_for(MAX_TIMES + 1), count=num_noted),
        times(identity("owner of the table", mission), NUM_SENT),
        PacketField(name="how much its owner knew", bits=32, count=NUM_SENT),
        PacketField(name="law of fades and losses", bits=bits_for(len(LAWS)), count=NUM_SENT),
        PacketField(name="mean excess of a link, in the table", low=-32.0, **in_table),
        PacketField(name="standard deviation of a link, in the table", **in_table),
    )


def carries(fields: tuple[PacketField, ...], mission: Mission) -> bool:
    """Return whether the mission's slots hold a whole packet with these fields."""
    return fits(packet_of(mission, fields), mission)


def check_room(mission: Mission) -> None:
    """Pass if the mission's slots hold snapshots.

    Raises:
        ValueError: They do not; the message names the least bit rate that would do.
    """
    fields = snapshot_fields(mission)
    if mission.bit_rate is None or carries(fields, mission):
        return
    needed = packet_of(mission, fields).num_bytes
    raise ValueError(
        f"packets of planner need {needed:,} bytes, but a slot holds {slot_bytes(mission):,} bytes "
        f"at {bits_per_second(mission.bit_rate)}; choose a bit rate of "
        f"{least_bit_rate(needed, mission):g} or more, or planner --payload none"
    )
