"""`swarm-mj doctor`: what is installed, what works on this machine, how to mend what does not."""

import json
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from itertools import groupby
from pathlib import Path
from textwrap import shorten
from typing import Any, ClassVar, Literal, NamedTuple

from packaging.requirements import Requirement
from rich.console import Console
from rich.table import Column, Table

from swarm_mj.cli import main
from swarm_mj.radio import reception
from swarm_mj.replay.rendering import opengl
from swarm_mj.replay.view import has_display
from swarm_mj.system.exit_codes import DONE, FAILED
from swarm_mj.system.fields import setting
from swarm_mj.system.needs import free_memory, free_room, in_gb
from swarm_mj.system.packages import CORE, commit, version
from swarm_mj.system.processes import attempt
from swarm_mj.system.terminal import num_cores, plain_console
from swarm_mj.system.writing import check_writable

Health = Literal["ok", "absent", "broken"]  # absent: flying does without; broken: nothing flies
MARKS = {"ok": "ok", "absent": "-", "broken": "BROKEN"}
PACKAGE = "swarm_mj"
MAX_LETTERS = 400  # of what a trial complains, cut between words
FLIGHT = (  # the arguments of a flight that takes a moment
    *("fly", "--task", "stationary", "--policy", "tdma", "--robots", "3", "--windows", "5"),
    *("--range-ratio", "10", "--no-record"),
)
RENDERING = {  # MuJoCo's back ends, and how to get each
    "egl": "needs a graphics driver with EGL; or use osmesa",
    "osmesa": "Debian and Ubuntu: apt-get install libosmesa6",
    "glfw": "needs a display; else use egl or osmesa",
}


class Finding(NamedTuple):
    """One thing that was looked at."""

    group: str  # the heading it stands under
    name: str
    state: Health
    found: str = ""
    mend: str = ""  # what to do, if it is not ok


@dataclass(frozen=True, kw_only=True)
class DoctorOptions:
    """The options of `swarm-mj doctor`."""

    EPILOG: ClassVar = "Exit codes: 0 swarm_mj works, 1 something that it needs is broken."
    json: bool = setting(False, "print JSON in place of the table")


def run(options: DoctorOptions) -> int:
    """Run the command; return its exit code."""
    with Console(stderr=True).status("Trying things out ..."):
        found = [*packages(), *tried(), *machine()]
    works = all(each.state != "broken" for each in found)
    if options.json:
        document = {"works": works, "findings": [each._asdict() for each in found]}
        sys.stdout.write(json.dumps(document, indent=2) + "\n")
    else:
        _print(found, works=works)
    return DONE if works else FAILED


def packages() -> Iterator[Finding]:
    """Find this version, each package that an installation brings, then each extra as a whole."""
    at = f", commit {commit()}" if commit() else ""
    on = f"{platform.python_version()} on {platform.platform()}"
    yield Finding("swarm_mj", "version", "ok", version() + at)
    yield Finding("swarm_mj", "Python", "ok", on)
    asked = [Requirement(text) for text in metadata.requires(PACKAGE) or ()]
    brought = [each for each in asked if each.marker is None or each.marker.evaluate({"extra": ""})]
    for each in brought:
        found = _packages(each.name, [each])
        if found.state == "absent" and each.name in CORE:
            found = found._replace(state="broken", found=f"{found.found}; flying needs it")
        yield found
    for extra in metadata.metadata(PACKAGE).get_all("Provides-Extra") or ():
        added = [each for each in asked if each not in brought and each.name != PACKAGE]
        own = [each for each in added if each.marker and each.marker.evaluate({"extra": extra})]
        yield _packages(f"extra {extra}", own)


def _packages(name: str, asked: Sequence[Requirement]) -> Finding:
    """Find out whether packages are installed as asked; name those to install, and no others.

    An extra of this package's own would bring all that the small core does without.
    """
    problems = []
    wanted = []
    found = "installed"
    for each in asked:
        try:
            found = metadata.version(each.name)
        except metadata.PackageNotFoundError:
            problems.append(f"{each.name} is not installed")
            wanted.append(_as_installed(each))
        else:
            if not each.specifier.contains(found, prereleases=True):
                problems.append(f"{each.name} {found} is not {each.specifier}")
                wanted.append(_as_installed(each))
    if problems:
        mend = f"pip install {' '.join(wanted)}"
        return Finding("packages", name, "absent", ", ".join(problems), mend)
    return Finding("packages", name, "ok", found if name == asked[0].name else "installed")


def _as_installed(package: Requirement) -> str:
    """Return a package as one types it after `pip install`."""
    extras = f"[{','.join(sorted(package.extras))}]" if package.extras else ""
    return f"'{package.name}{extras}{package.specifier}'"


def tried() -> Iterator[Finding]:
    """Fly, and render by each back end, to find what works."""
    mend = "see what `swarm-mj fly` says"
    failed = Finding("flying", "three robots fly", "broken", mend=mend)
    yield _of_trial(failed, attempt(fly_three_robots))
    for name, mend in RENDERING.items():
        failed = Finding("rendering without a display", f"MUJOCO_GL={name}", "absent", mend=mend)
        yield _of_trial(failed, attempt(opengl.render_nothing, opengl.variables_of(name)))


def fly_three_robots() -> None:
    """Fly a moment, and end this process as `swarm-mj fly` would; tried in one of its own."""
    sys.exit(main(FLIGHT))


def _of_trial(failed: Finding, outcome: tuple[bool, str]) -> Finding:
    """Return what a trial shows by its end: that a thing works, or as it is found if not."""
    works, said = outcome
    if works:
        return failed._replace(state="ok", found="works", mend="")
    return failed._replace(found=shorten(said, MAX_LETTERS, placeholder=" ..."))


def machine() -> Iterator[Finding]:
    """Find cores, memory, disk, a place for compiled code, and a display."""
    threads = os.environ.get("OMP_NUM_THREADS")
    set_to = f", OMP_NUM_THREADS={threads}" if threads else ""
    yield Finding("speed", "cores", "ok", f"{num_cores()} may be used{set_to}")
    yield _compiled_code()
    yield Finding("room", "memory free", "ok", in_gb(free_memory()))
    yield Finding("room", "disk free here", "ok", in_gb(free_room(Path.cwd())))
    state, mend = ("ok", "") if has_display() else ("absent", "`swarm-mj replay --web` needs none")
    yield Finding("rerun's viewer", "display", state, "there is one" if not mend else "none", mend)


def _compiled_code() -> Finding:
    """Find where numba keeps what it compiled; without a place every start compiles."""
    compiled: Any = reception.sinr
    folder = compiled.stats.cache_path
    problem = "not kept: every start compiles anew"
    try:
        if folder is not None:
            check_writable(Path(folder) / "kernels")
            return Finding("speed", "compiled code", "ok", f"kept in {folder}")
    except OSError as error:
        problem = f"{folder} cannot be written ({error})"
    mend = "set NUMBA_CACHE_DIR to a folder that you can write"
    return Finding("speed", "compiled code", "absent", problem, mend)


def _print(found: list[Finding], *, works: bool) -> None:
    """Print a table by groups, then what to do, then whether flying works."""
    table = Table(*(Column(overflow="fold") for _ in range(3)), show_header=False)
    for group, findings in groupby(found, lambda each: each.group):
        table.add_row(f"[bold]{group}[/bold]")
        for each in findings:
            table.add_row(f"  {each.name}", MARKS[each.state], each.found)
        table.add_section()
    Console(highlight=False, markup=True).print(table)
    lacking = [f"  {each.name}: {each.mend}" for each in found if each.state != "ok"]
    verdict = "works here." if works else "does not work here until what is BROKEN is mended."
    advice = ["What to do, if you need it:", *lacking] if lacking else []
    plain_console().print("\n".join([*advice, f"swarm_mj {verdict}"]))
