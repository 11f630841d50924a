"""Replays as CSV tables: positions, packets and ages."""

import csv
import io
from collections.abc import Callable, Iterable

from swarm_mj.replay.export.flown import FlownWindows, number

POSITION_COLUMNS = ("window", "seconds", "robot", "x_m", "y_m", "vx_mps", "vy_mps", "is_on")
UPWARD_COLUMNS = ("z_m", "vz_mps")  # of robots with bodies, after the others
PACKET_COLUMNS = (
    *("window", "slot", "seconds", "sender", "recipient", "fate", "num_receivers", "receivers"),
)
AGE_COLUMNS = ("window", "seconds", "aoi", "aoi_std", "aoi_worst", "observer")


class CsvTable:
    """A CSV file that grows by rows; an empty cell is what is not known."""

    def __init__(self, columns: Iterable[str]) -> None:
        """Begin with the names of the columns."""
        self._text = io.StringIO()
        self._writer = csv.writer(self._text, lineterminator="\n")
        self._writer.writerow(columns)

    def add(self, *cells: object) -> None:
        """Add a row; None is an empty cell."""
        self._writer.writerow(cells)

    @property
    def content(self) -> bytes:
        """The whole file."""
        return self._text.getvalue().encode()


def positions_table(flown: FlownWindows, advance: Callable[[], None]) -> bytes:
    """Return the table of positions and velocities: a row for each window and robot."""
    columns = POSITION_COLUMNS
    if flown.has_bodies:
        columns += UPWARD_COLUMNS
    table = CsvTable(columns)
    footage = flown.footage
    for row, window in enumerate(footage.window.tolist()):
        seconds = flown.begin_s(row)
        velocity_mps = flown.velocity_mps(row)
        for robot, (x_m, y_m, z_m) in enumerate(flown.place_m[row].tolist()):
            vx_mps, vy_mps, vz_mps = velocity_mps[robot]
            upwards = (number(z_m), number(vz_mps)) if flown.has_bodies else ()
            table.add(
                window,
                seconds,
                robot,
                number(x_m),
                number(y_m),
                number(vx_mps),
                number(vy_mps),
                int(footage.is_on[row, robot]),
                *upwards,
            )
        advance()
    return table.content


def packets_table(flown: FlownWindows, advance: Callable[[], None]) -> bytes:
    """Return the table of packets, in the order in which they were sent."""
    table = CsvTable(PACKET_COLUMNS)
    for row, window in enumerate(flown.footage.window.tolist()):
        for packet in flown.packets(row):
            table.add(
                window,
                packet.slot,
                packet.begin_s,
                packet.sender,
                packet.recipient,
                packet.fate,
                len(packet.receivers),
                " ".join(map(str, packet.receivers)),
            )
        advance()
    return table.content


def ages_table(flown: FlownWindows, advance: Callable[[], None]) -> bytes:
    """Return the table of ages at the end of each window: the team's, and what the observer has."""
    table = CsvTable([*AGE_COLUMNS, *(f"r{robot}" for robot in range(flown.num_robots))])
    footage = flown.footage
    for row, window in enumerate(footage.window.tolist()):
        ages = flown.ages(row)
        seconds = flown.end_s(row)
        table.add(window, seconds, ages.mean, ages.std, ages.worst, footage.ego, *ages.known)
        advance()
    return table.content
