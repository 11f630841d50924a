"""What the planner's packets carry beyond T, M and P, field by field."""

from swarm_mj.mission import Mission
from swarm_mj.protocol.packets import (
    POSITION_BITS,
    PacketField,
    age,
    identity,
    position,
    times,
)

NUM_SNAPSHOTS = 2  # the one that the sender flies by, and the best for the next epoch
SPEED_BITS = 16
TABLE_BITS, TABLE_STEP_WINDOWS = 16, 1 / 16  # ages of up to 4,096 windows


def snapshot_fields(mission: Mission) -> tuple[PacketField, ...]:
    """Two snapshots, each with the N² ages that the plan before it leads to.

    How far positions err follows from their ages and one number, how much velocities differ.
    """
    num_robots = mission.num_robots
    most_mps = 2.0 * mission.max_velocity_mps
    snapshot = (
        identity("owner of the snapshot", mission),
        PacketField(name="robots known to the owner", bits=1, count=num_robots),
        times(age("age in the snapshot"), num_robots),
        times(position("position in the snapshot", mission, POSITION_BITS), num_robots),
        PacketField(
            name="spread of velocities",
            bits=SPEED_BITS,
            step=most_mps / 2**SPEED_BITS,
            unit="m/s",
        ),
        PacketField(
            name="expected age, of all pairs",
            bits=TABLE_BITS,
            count=num_robots**2,
            step=TABLE_STEP_WINDOWS,
            unit="windows",
        ),
    )
    return tuple(times(each, NUM_SNAPSHOTS) for each in snapshot)
