"""The formats that replays are exported to, and the files of each."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from swarm_mj.replay.export.flown import Flown
from swarm_mj.replay.export.ns2 import trace
from swarm_mj.replay.export.tables import ages_table, packets_table, positions_table
from swarm_mj.system.packages import need

Format: TypeAlias = Literal["mcap", "ns2", "csv"]
FORMATS: tuple[Format, ...] = get_args(Format)

# Makes a file's content of a flight; it counts each window as done.
Make: TypeAlias = Callable[[Flown, Callable[[], None]], bytes]


def check_packages(to: Format) -> None:
    """Raise ModuleNotFoundError, with the way out, unless a format's packages are installed."""
    if to == "mcap":
        for module in ("mcap", "mcap_protobuf", "foxglove_schemas_protobuf"):
            need(module, "an MCAP file", "pip install 'swarm_mj[mcap]' for all that it needs")


def files_of(to: Format, stem: Path) -> dict[Path, Make]:
    """Return the files of a format, by how their names begin, each with what makes it."""
    made: dict[str, Make]
    match to:
        case "mcap":
            made = {".mcap": _recording}
        case "ns2":
            made = {".tcl": trace, "-packets.csv": packets_table}
        case "csv":
            made = {
                "-positions.csv": positions_table,
                "-packets.csv": packets_table,
                "-ages.csv": ages_table,
            }
    return {stem.with_name(f"{stem.name}{ending}"): make for ending, make in made.items()}


def _recording(flown: Flown, advance: Callable[[], None]) -> bytes:
    from swarm_mj.replay.export.foxglove import recording  # its packages are an extra

    return recording(flown, advance)
