"""`swarm-mj export`: writes a replay as files that other tools read."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from rich.console import Console

from swarm_mj.replay.export.formats import FORMATS, check_packages, files_of
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import files_read, setting, the_file
from swarm_mj.system.interrupt import held_interrupts, raise_if_interrupted
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import WorkBar, say_written
from swarm_mj.system.writing import Output, check_outputs, write_bytes

ENDINGS = {".rrd", ".mcap", ".tcl", ".csv"}  # of files: those of a format may be typed, too


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """The options of `swarm-mj export`."""

    EPILOG: ClassVar = (
        "mcap: NAME.mcap for Foxglove, with the robots as a scene and as transforms. "
        "ns2: NAME.tcl for ns-3, how the robots moved, and NAME-schedule.csv, who sent when. "
        "csv: NAME-positions.csv, NAME-packets.csv and NAME-ages.csv."
    )
    file: Path = setting(
        help="an .rrd file that `swarm-mj fly` recorded", is_positional=True, reads=the_file
    )
    to: str = setting(help="the format", choices=FORMATS, metavar="FORMAT")
    out: Path | None = setting(
        None,
        "how the names of the files begin",
        metavar="NAME",
        shown="as the replay's, beside it",
    )
    force: bool = setting(False, "replace existing files")


def run(options: ExportOptions) -> int:
    """Run the command; return its exit code."""
    files = files_of(options.to, _stem(options))
    check_outputs(
        *(Output("export", file) for file in files),
        inputs=files_read(options),
        must_be_new=not options.force,
    )
    need("rerun", "an export")
    check_packages(options.to)
    with Console(stderr=True, highlight=False).status("Reading ..."):
        from swarm_mj.replay.read import read_flown  # rerun is slow to import

        flown = read_flown(options.file)
    contents: dict[Path, bytes] = {}
    num_windows = len(flown.footage.window)
    with WorkBar("Exporting", num_windows * len(files), "windows") as bar:
        for file, make in files.items():
            contents[file] = make(flown, bar.advance)
    raise_if_interrupted()  # a library may have swallowed it
    with held_interrupts():  # all files or none, unless the disk fails
        for file, content in contents.items():
            write_bytes(file, content)
    for file, content in contents.items():
        say_written(file, f"{len(content) / 1e3:,.0f} kB")
    return DONE


def _stem(options: ExportOptions) -> Path:
    """Return how the files' names begin; raise ValueError for what can begin no name."""
    if options.out is None:
        return options.file.with_suffix("")
    stem = options.out
    if stem.name in ("", ".."):
        raise ValueError(f"out must be how the names of files begin, not {stem}")
    ending = stem.suffix.lower()
    own = {file.suffix for file in files_of(options.to, stem.with_suffix(""))}
    if ending in ENDINGS - own:
        names = " and ".join(file.name for file in files_of(options.to, Path("NAME")))
        raise ValueError(f"{options.to} writes {names}, not {stem.name}; leave {ending} out")
    return stem.with_suffix("") if ending in own else stem
