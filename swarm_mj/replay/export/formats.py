"""The formats that replays are exported to, and the files of each."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from swarm_mj.replay.export.flown import FlownWindows
from swarm_mj.replay.export.ns2 import trace
from swarm_mj.replay.export.tables import ages_table, packets_table, positions_table
from swarm_mj.system.packages import need

# Makes a file's content of a flight; it counts each window as done.
Make: TypeAlias = Callable[[FlownWindows, Callable[[], None]], bytes]


def _recording(flown: FlownWindows, advance: Callable[[], None]) -> bytes:
    from swarm_mj.replay.export.foxglove import recording  # its packages are an extra

    return recording(flown, advance)


# What makes each file of a format, by how the file's name ends.
FORMATS: Mapping[str, Mapping[str, Make]] = {
    "mcap": {".mcap": _recording},
    "ns2": {".tcl": trace, "-schedule.csv": packets_table},
    "csv": {
        "-positions.csv": positions_table,
        "-packets.csv": packets_table,
        "-ages.csv": ages_table,
    },
}


def check_packages(to: str) -> None:
    """Raise ModuleNotFoundError, with the way out, unless a format's packages are installed."""
    if to == "mcap":
        for module in ("mcap", "mcap_protobuf", "foxglove_schemas_protobuf"):
            need(module, "an MCAP file", "pip install 'swarm_mj[mcap]' for all that it needs")


def files_of(to: str, stem: Path) -> dict[Path, Make]:
    """Return the files of a format, by how their names begin, each with what makes it."""
    return {stem.with_name(f"{stem.name}{ending}"): make for ending, make in FORMATS[to].items()}
