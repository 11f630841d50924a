"""Flights and trainings shown while they go on, as `fly`, `evaluate` and `train` share it."""

import atexit
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from swarm_mj.replay import view
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.view import LiveViewer
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import plain_console

if TYPE_CHECKING:  # rerun is slow to import
    from swarm_mj.replay.live import LiveReplay

WHERE = (view.WINDOW, view.WEB)
AS_FAST_AS_IT_GOES = "max"
_kept_open = ExitStack()  # viewers of flights from Python, which stay when `fly` returns
atexit.register(_kept_open.close)


def _speed(typed: str) -> float | None:
    return None if typed == AS_FAST_AS_IT_GOES else float(typed)


live_option = partial(
    setting,
    None,
    choices=WHERE,
    bare=view.WINDOW,
    metavar="[web]",
    group="output",
    is_common=True,
)
speed_option = partial(
    setting,
    None,
    "of a --live flight: 1 is the mission's own time; max, as fast as it goes",
    low=0.01,
    high=1000.0,
    shown=AS_FAST_AS_IT_GOES,
    convert=_speed,
    metavar="X",
    group="output",
)


def check_live(where: str | None, speed: float | None, *, given: str = "--live") -> None:
    """Raise ValueError or ModuleNotFoundError if nothing can be shown so.

    Args:
        where: How to show it; None if no live replay was asked for.
        speed: The speed asked for; None if there was none.
        given: What asked for it, and may be left out.
    """
    if where is None:
        if speed is not None:
            raise ValueError(f"--speed {speed:g} is of live flights; add --live")
        return
    need("rerun", "a live replay", f"do without one: leave out {given}")
    view.check_screen(where)


class LiveFlight:
    """Shows one flight in a viewer that is open."""

    def __init__(
        self, viewer: LiveViewer, name: str, *, has_file: bool = False, speed: float | None = None
    ) -> None:
        """Prepare for a flight of this name, at this speed, None for the highest.

        With a file, `save` will write it.
        """
        self._viewer = viewer
        self._name = name
        self._has_file = has_file
        self._speed = speed
        self._replay: LiveReplay | None = None

    def begin(self, recorder: Recorder, config: Mapping[str, Any]) -> "LiveReplay":
        """Return what shows a flight; `Shows` of `swarm_mj.api.flight`."""
        from swarm_mj.replay.live import LiveReplay

        played = None if self._speed is None else self._speed / config["window_s"]
        self._replay = LiveReplay(
            recorder,
            config,
            self._name,
            self._viewer.address,
            has_file=self._has_file,
            windows_per_second=played,
        )
        return self._replay

    def save(self, path: Path) -> None:
        """Write what was shown to a file; or raise OSError."""
        assert self._replay is not None
        self._replay.save(path)


@contextmanager
def open_viewer(where: str, console: Console) -> Iterator[LiveViewer]:
    """Open a viewer for the block, and say where, if it is no window; raise OSError if it fails."""
    with ExitStack() as stack:
        with console.status("Opening the viewer ..."):
            viewer = stack.enter_context(view.live_viewer(where))
        if viewer.page is not None:
            plain_console().print(f"Open {viewer.page}\nCtrl-C ends it.")
        yield viewer


def keep_open(viewer: LiveViewer) -> int:
    """Say that the viewer stays, and wait until it is closed; return the exit code."""
    if viewer.page is None:
        plain_console().print("The viewer stays open; close it to end.")
    else:
        plain_console().print(f"The viewer stays at {viewer.page}\nCtrl-C ends it.")
    return viewer.wait()


def viewer_to_keep(where: str | bool, console: Console) -> LiveViewer:
    """Open a viewer that stays open until Python ends, and say where; raise as `open_viewer`."""
    asked = view.WINDOW if where is True else str(where)
    if asked not in WHERE:
        raise ValueError(f'live must be True or "web", not {where!r}')
    check_live(asked, None, given=f"live={where!r}")
    return _kept_open.enter_context(open_viewer(asked, console))
