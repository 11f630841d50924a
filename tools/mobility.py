"""Writes how the robots of a replay move: a trace that ns-3 reads, or a table.

    python tools/mobility.py replays/mission.rrd --out mission.tcl
    python tools/mobility.py replays/mission.rrd --out mission.csv

A .tcl file is a trace of ns-2's `setdest`, for ns-3's `Ns2MobilityHelper`. Time is the mission's,
in seconds; robots go straight from where they are at the end of a window to the end of the next.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarm_mj.cli import script
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.read import read_footage
from swarm_mj.system.fields import files_read, setting, the_file
from swarm_mj.system.writing import Output, check_outputs, write_text


@dataclass(frozen=True, kw_only=True)
class Options:
    """What is read, and what is written."""

    replay: Path = setting(
        help="an .rrd file that `swarm-mj fly` recorded", is_positional=True, reads=the_file
    )
    out: Path = setting(Path("mission.tcl"), "the trace, or the table", metavar="FILE.tcl|.csv")
    force: bool = setting(False, "replace an existing file")


def run(options: Options) -> int:
    """Write the movements; return the exit code."""
    output = Output("file", options.out, ".tcl|.csv")
    check_outputs(output, inputs=files_read(options), must_be_new=not options.force)
    lines = (as_table if options.out.suffix.lower() == ".csv" else as_trace)(
        read_footage(options.replay)
    )
    write_text(options.out, "".join(f"{line}\n" for line in lines))
    print(options.out)
    return 0


def as_table(footage: Footage) -> Iterator[str]:
    """Return the lines of a table: where each robot is at the end of each window."""
    yield "time_s,robot,x_m,y_m"
    for time_s, position_m in zip(times_s(footage), footage.position_m.tolist(), strict=True):
        yield from (f"{time_s:.9g},{i},{x!r},{y!r}" for i, (x, y) in enumerate(position_m))


def as_trace(footage: Footage) -> Iterator[str]:
    """Return the lines of a trace of ns-2."""
    at_s, position_m = times_s(footage), footage.position_m
    for i, (x, y) in enumerate(position_m[0].tolist()):
        yield f"$node_({i}) set X_ {x!r}"
        yield f"$node_({i}) set Y_ {y!r}"
        yield f"$node_({i}) set Z_ 0.0"
    way_m = np.linalg.norm(np.diff(position_m, axis=0), axis=2)
    speed_mps = way_m / np.diff(at_s)[:, np.newaxis]
    for k, i in np.argwhere(way_m > 0.0).tolist():
        x, y = position_m[k + 1, i].tolist()
        yield (
            f'$ns_ at {at_s[k]:.9g} "$node_({i}) setdest {x!r} {y!r} {speed_mps[k, i].item()!r}"'
        )


def times_s(footage: Footage) -> list[float]:
    """Return the mission's time at the end of each window [s]."""
    return (footage.window * footage.facts.mission.window_s).tolist()


if __name__ == "__main__":
    sys.exit(script(Options, run))
