"""Packets: their fields and widths, and how many entries fit into a slot.

The paper's packets hold the sender's buffer: T, M and P of every robot (II-B). The simulation hands
these numbers over as they are. The widths here are what they would take on the air, and a test
holds every field to the precision that it promises. What the radio itself adds, such as preambles
and checksums, is not counted.
"""

import math
from dataclasses import dataclass, replace

from swarm_mj.mission import Mission
from swarm_mj.protocol.buffers import NO_PARENT
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.words import bits_per_second

MAX_STDS = 10.0  # more than any error of a position
BITS_PER_BYTE = 8
DIGITS = 6  # that count behind the point; smaller parts are the rounding of a product
POSITION_BITS = 16  # per axis
VELOCITY_BITS = 8  # per axis
AGE_BITS = 16  # ages of up to 32,767 windows; older ones count as that old


@dataclass(frozen=True, kw_only=True)
class PacketField:
    """Numbers of one kind in a packet: code n stands for `low` + n `step`, or what lies beyond."""

    name: str
    bits: int  # of one number
    count: int = 1  # numbers in a packet, or in an entry of it
    low: float = 0.0  # the least number
    step: float = 1.0  # from one number to the next
    unit: str = ""

    @property
    def num_bits(self) -> int:
        """Bits of all its numbers."""
        return self.bits * self.count


@dataclass(frozen=True, kw_only=True)
class Packet:
    """A policy's packet: a header, entries of T, M and P, a payload.

    The header has a bit for every robot, which says whether its entry follows.
    """

    header: tuple[PacketField, ...]
    entry: tuple[PacketField, ...]
    num_entries: int  # at most
    payload: tuple[PacketField, ...] = ()  # beyond T, M and P

    @property
    def num_bytes(self) -> int:
        """Bytes of a packet with all these entries."""
        entries = self.num_entries * _num_bits(self.entry)
        bits = _num_bits(self.header) + entries + _num_bits(self.payload)
        return -(-bits // BITS_PER_BYTE)


def packet_of(mission: Mission, payload: tuple[PacketField, ...] = ()) -> Packet:
    """Return the packet that holds a whole buffer of a mission's robots, and a payload."""
    header = (
        identity("sender", mission),
        identity("addressee", mission),
        PacketField(name="robots described", bits=1, count=mission.num_robots),
    )
    entry = (
        age("age (T)"),
        position("position (M)", mission, POSITION_BITS),
        _symmetric("velocity (M)", mission, VELOCITY_BITS, mission.max_velocity_mps, "m/s"),
        identity("parent (P)", mission),
    )
    return Packet(header=header, entry=entry, num_entries=mission.num_robots, payload=payload)


def identity(name: str, mission: Mission) -> PacketField:
    """Return a robot, or none: one byte for up to 255 robots, two for more."""
    bits = BITS_PER_BYTE * (1 if mission.num_robots < 2**BITS_PER_BYTE else 2)
    return PacketField(name=name, bits=bits, low=float(NO_PARENT))


def age(name: str) -> PacketField:
    """Return an age; observations are half a window apart, so it is exact."""
    return PacketField(name=name, bits=AGE_BITS, step=SLOT_WINDOWS, unit="windows")


def position(name: str, mission: Mission, bits: int) -> PacketField:
    """Return a place that robots may report; 16 bits step by 1.5 cm for 40 robots within walls."""
    # Teams without walls leave their area, at most with their largest velocity.
    duration_s = mission.num_windows * mission.window_s
    outside_m = 0.0 if mission.has_walls else mission.max_velocity_mps * duration_s
    outside_m += MAX_STDS * mission.position_noise_m
    highest_m = mission.height_m + mission.height_range_m if mission.has_bodies else 0.0
    return _symmetric(name, mission, bits, max(mission.half_side_m, highest_m) + outside_m, "m")


def bits_for(count: int) -> int:
    """Return the bits of a number below a count."""
    return max(1, (count - 1).bit_length())


def times(field: PacketField, count: int) -> PacketField:
    """Return a field repeated."""
    return replace(field, count=field.count * count)


def _symmetric(name: str, mission: Mission, bits: int, most: float, unit: str) -> PacketField:
    """Return all axes from -most to most; 0 is a code, so that robots at rest are seen to rest."""
    step = most / (2 ** (bits - 1) - 1)
    low = -step * 2 ** (bits - 1)
    return PacketField(name=name, bits=bits, count=mission.num_axes, low=low, step=step, unit=unit)


def slot_bytes(mission: Mission, taken_s: float = 0.0) -> int | None:
    """Return the bytes of a slot at the mission's bit rate; None if it holds any packet.

    What is taken of it comes before the packet, such as minislots [s].
    """
    if mission.bit_rate is None:
        return None
    bits = mission.bit_rate * (mission.slot_s - taken_s)
    return math.floor(round(bits / BITS_PER_BYTE, DIGITS))


def fits(packet: Packet, mission: Mission, taken_s: float = 0.0) -> bool:
    """Return whether a slot of the mission, or what is left of it, holds a packet."""
    capacity = slot_bytes(mission, taken_s)
    return capacity is None or packet.num_bytes <= capacity


def check_fits_slot(
    what: str,
    packet: Packet,
    mission: Mission,
    *,
    why: str = "",
    otherwise: str = "",
    taken_s: float = 0.0,
) -> None:
    """Raise ValueError unless a slot holds a packet; the texts complete the message."""
    rate = mission.bit_rate
    capacity = slot_bytes(mission, taken_s)
    if rate is not None and capacity is not None and packet.num_bytes > capacity:
        left_s = mission.slot_s - taken_s
        needed = packet.num_bytes * BITS_PER_BYTE / left_s
        least = math.ceil(round(needed, DIGITS))
        raise ValueError(
            f"{what} {packet.num_bytes:,} bytes{why}, but a slot holds {capacity:,} bytes at "
            f"{bits_per_second(rate)}; choose a bit rate of {least} or more{otherwise}"
        )


def fitting(packet: Packet, mission: Mission, policy: str, taken_s: float = 0.0) -> Packet:
    """Return a packet with the entries that a slot holds; ValueError if it holds not even one.

    What is taken of a slot comes before the packet [s].
    """
    capacity = slot_bytes(mission, taken_s)
    if capacity is None or fits(packet, mission, taken_s):
        return packet
    least = replace(packet, num_entries=1)
    needs = f"packets of {policy} need"
    check_fits_slot(needs, least, mission, why=" for a single entry", taken_s=taken_s)
    spare = BITS_PER_BYTE * (capacity - least.num_bytes)
    return replace(packet, num_entries=1 + spare // _num_bits(packet.entry))


def check_whole(what: str, mission: Mission) -> None:
    """Raise ValueError, naming what needs it, unless a slot holds a whole buffer."""
    needs = f"{what} requires unfragmented packets of"
    check_fits_slot(needs, packet_of(mission), mission, otherwise=", or fewer robots")


def _num_bits(fields: tuple[PacketField, ...]) -> int:
    return sum(each.num_bits for each in fields)
