"""What the planner's packets carry beyond T, M and P: two snapshots, whole or lean, or links.

Whole snapshots hold N² ages, those that the plan before leads to, so packets grow with the square
of the team. Where a slot does not hold them, lean ones go without: every plan then begins with a
team that knows nothing. They are also coarser: ages step by a window or more, positions by 25 cm
for 40 robots within walls. Robots fly by snapshots as they arrive, so that all plan alike.

Teams at rest need no snapshots. Their packets carry what robots observed of links, and two tables
made of it: the one that the sender flies by, and the best of the next.
"""

from dataclasses import dataclass, replace

import numpy as np

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.link_evidence import MAX_KINDS, MOST_TIMES, NUM_BINS
from swarm_mj.policies.planner.link_tables import LAWS, STEP_DB
from swarm_mj.policies.planner.snapshots import Snapshots
from swarm_mj.protocol.buffers import NEVER
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

NUM_SNAPSHOTS = 2  # the one that the sender flies by, and the best for the next epoch
SPEED_BITS = 16
TABLE_BITS, TABLE_STEP_WINDOWS = 16, 1 / 16  # ages of up to 4,096 windows
RANK_BITS = 32
LINK_BITS = 8  # of each number that a table says of a link
LEAN_AGE_BITS, LEAN_POSITION_BITS = 8, 12
LEAN_ROUNDS = 4  # ages of up to so many rounds of N windows are told apart


@dataclass(frozen=True, kw_only=True)
class SnapshotForm:
    """How much of two snapshots packets carry, and how precisely."""

    payload: str  # what it is called
    age: PacketField
    position: PacketField
    others: tuple[PacketField, ...]  # of one snapshot
    has_table: bool  # whether a plan begins with what the plan before leads to
    is_coarse: bool  # whether what arrives is rounded

    @property
    def fields(self) -> tuple[PacketField, ...]:
        """Of both snapshots."""
        one = (*self.others, self.age, self.position)
        return tuple(times(field, NUM_SNAPSHOTS) for field in one)

    def arrived(self, snapshots: Snapshots, now: float, windows_ahead: float) -> Snapshots:
        """Snapshots as they arrive.

        Args:
            snapshots: As they were taken.
            now: t then [windows].
            windows_ahead: From then to the middle of their epoch [windows].
        """
        if not self.is_coarse:
            return snapshots
        taken = now - snapshots.timestamp
        told = self.age.rounded(taken)
        grown = (told + windows_ahead) / (taken + windows_ahead)
        return replace(
            snapshots,
            timestamp=np.maximum(now - told, NEVER),
            position_m=self.position.rounded(snapshots.position_m),
            position_std_m=snapshots.position_std_m * grown,
        )


def snapshot_form(mission: Mission) -> SnapshotForm:
    """Return the richest form of which packets fit into the mission's slots.

    Raises:
        ValueError: None does.
    """
    whole, lean = whole_form(mission), lean_form(mission)
    for form in (whole, lean):
        if fits(packet_of(mission, form.fields), mission):
            return form
    least = packet_of(mission, lean.fields).num_bytes
    one_entry = replace(packet_of(mission), num_entries=1)
    other_way = ", or planner --payload none" if fits(one_entry, mission) else ""
    raise ValueError(
        f"packets of planner need {least:,} bytes at least, but a slot holds "
        f"{slot_bytes(mission):,} bytes at {bits_per_second(mission.bit_rate or 0.0)}; choose a "
        f"bit rate of {least_bit_rate(least, mission):g} or more{other_way}"
    )


def whole_form(mission: Mission) -> SnapshotForm:
    """Snapshots as precise as T and M, and the N² ages that the plan before leads to."""
    num_robots = mission.num_robots
    table = PacketField(
        name="expected age, of all pairs",
        bits=TABLE_BITS,
        count=num_robots**2,
        step=TABLE_STEP_WINDOWS,
        unit="windows",
    )
    return SnapshotForm(
        payload="snapshots",
        age=times(age("age in the snapshot"), num_robots),
        position=times(position("position in the snapshot", mission, POSITION_BITS), num_robots),
        others=(*_common(mission), table),
        has_table=True,
        is_coarse=False,
    )


def lean_form(mission: Mission) -> SnapshotForm:
    """Snapshots without the N² ages, and coarser; what followed from exact ages is sent as well."""
    num_robots = mission.num_robots
    lean_age = PacketField(
        name="age in the snapshot",
        bits=LEAN_AGE_BITS,
        count=num_robots,
        step=max(1.0, LEAN_ROUNDS * num_robots / 2**LEAN_AGE_BITS),
        unit="windows",
    )
    lean_position = position("position in the snapshot", mission, LEAN_POSITION_BITS)
    return SnapshotForm(
        payload="lean snapshots",
        age=lean_age,
        position=times(lean_position, num_robots),
        others=(
            *_common(mission),
            PacketField(name="robots heard of lately", bits=1, count=num_robots),
            PacketField(name="their mean age", bits=RANK_BITS),
        ),
        has_table=False,
        is_coarse=True,
    )


def links_fit(mission: Mission) -> bool:
    """Whether the mission's slots hold what robots observed of links."""
    return fits(packet_of(mission, link_fields(mission)), mission)


def link_fields(mission: Mission) -> tuple[PacketField, ...]:
    """What robots observed, as much as they may note, and two tables of links."""
    num_robots = mission.num_robots
    num_noted = num_robots * MAX_KINDS
    num_links = NUM_SNAPSHOTS * num_robots * (num_robots - 1) // 2
    table = "of a link, in the table"
    return (
        PacketField(name="slot since which each robot plans", bits=16, count=num_robots),
        times(identity("sender of a kind of packet", mission), num_noted),
        PacketField(name="its margin", bits=bits_for(NUM_BINS), count=num_noted),
        PacketField(name="whether it was decoded", bits=1, count=num_noted),
        PacketField(name="how often", bits=bits_for(MOST_TIMES), count=num_noted),
        times(identity("owner of the table", mission), NUM_SNAPSHOTS),
        PacketField(name="how much its owner knew", bits=RANK_BITS, count=NUM_SNAPSHOTS),
        PacketField(name="law of fades and losses", bits=bits_for(len(LAWS)), count=NUM_SNAPSHOTS),
        PacketField(
            name=f"mean excess {table}",
            bits=LINK_BITS,
            count=num_links,
            low=-32.0,
            step=STEP_DB,
            unit="dB",
        ),
        PacketField(
            name=f"standard deviation {table}",
            bits=LINK_BITS,
            count=num_links,
            step=STEP_DB,
            unit="dB",
        ),
    )


def _common(mission: Mission) -> tuple[PacketField, ...]:
    """How far positions err follows from their ages and one number, how much velocities differ."""
    most_mps = 2.0 * mission.max_velocity_mps
    return (
        identity("owner of the snapshot", mission),
        PacketField(name="robots known to the owner", bits=1, count=mission.num_robots),
        PacketField(
            name="spread of velocities",
            bits=SPEED_BITS,
            step=most_mps / 2**SPEED_BITS,
            unit="m/s",
        ),
    )
