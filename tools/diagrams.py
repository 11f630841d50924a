"""The diagrams of `docs/concepts.md`.

    python tools/diagrams.py --out docs/pictures

Where a packet decodes and how news ages is simulated; the other places are made up. The pictures
take the light or dark colours that their reader's page has.
"""

import io
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch

from swarm_mj.cli import script
from swarm_mj.mission import paper
from swarm_mj.policies import make_policy
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.fields import setting
from swarm_mj.system.writing import write_text


class Ink(NamedTuple):
    """A colour of diagrams."""

    name: str  # in the file's style
    drawn: str  # by matplotlib, in whose file no other colour is like it
    light: str  # on a light page
    dark: str  # on a dark page


TEXT_INK = Ink("ink", "#010101", "#1f2328", "#e6edf3")
MUTED_INK = Ink("muted", "#010102", "#656d76", "#9da7b3")
CARD_INK = Ink("card", "#010103", "#f6f8fa", "#161b22")
LINE_INK = Ink("line", "#010104", "#c4ccd4", "#3d444d")
BLUE_INK = Ink("blue", "#010105", "#0969da", "#58a6ff")
ORANGE_INK = Ink("orange", "#010106", "#bc4c00", "#f0883e")
PALE_BLUE_INK = Ink("pale_blue", "#010107", "#cfe8ff", "#143556")
PALE_ORANGE_INK = Ink("pale_orange", "#010108", "#ffe2cc", "#4a2a12")
INKS = (
    TEXT_INK,
    MUTED_INK,
    CARD_INK,
    LINE_INK,
    BLUE_INK,
    ORANGE_INK,
    PALE_BLUE_INK,
    PALE_ORANGE_INK,
)
INK = TEXT_INK.drawn
MUTED = MUTED_INK.drawn
CARD = CARD_INK.drawn
LINE = LINE_INK.drawn
BLUE = BLUE_INK.drawn
ORANGE = ORANGE_INK.drawn
PALE_BLUE = PALE_BLUE_INK.drawn
PALE_ORANGE = PALE_ORANGE_INK.drawn
STYLE: dict[Any, Any] = {
    "axes.edgecolor": LINE,
    "axes.facecolor": "none",
    "axes.labelcolor": MUTED,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.facecolor": CARD,
    "font.size": 10,
    "svg.hashsalt": "swarm_mj",
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Where the diagrams go."""

    out: Path = setting(Path("docs/pictures"), "an existing folder", metavar="FOLDER")


def run(options: Options) -> int:
    """Draw all diagrams; return the exit code."""
    for name, draw in DIAGRAMS.items():
        path = options.out / f"{name}.svg"
        with plt.rc_context(STYLE):
            write_text(path, themed(draw()))
        print(path)
    return 0


def themed(figure: Figure) -> str:
    """Return a figure as SVG whose colours follow the page's theme."""
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    plt.close(figure)
    svg = drawn.getvalue()
    for ink in INKS:
        svg = svg.replace(ink.drawn, f"var(--{ink.name})")
    light = "".join(f"--{ink.name}:{ink.light};" for ink in INKS)
    dark = "".join(f"--{ink.name}:{ink.dark};" for ink in INKS)
    rules = f":root{{{light}}}@media(prefers-color-scheme:dark){{:root{{{dark}}}}}"
    return svg.replace("<defs>", f"<defs>\n  <style>{rules}</style>", 1)


def _box(axes: Axes, place: tuple[float, float], text: str, *, colour: str = LINE) -> None:
    x, y = place
    outline = FancyBboxPatch(
        (x - 1.05, y - 0.36), 2.1, 0.72, boxstyle="round,pad=0.02,rounding_size=0.12"
    )
    outline.set(facecolor=CARD, edgecolor=colour, linewidth=1.5)
    axes.add_patch(outline)
    axes.text(x, y, text, ha="center", va="center", linespacing=1.35)


def _arrow(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    *,
    colour: str = MUTED,
    bend: float = 0.0,
    dashes: str = "-",
    gap: float = 1.0,
) -> None:
    arrow = FancyArrowPatch(
        start, end, arrowstyle="-|>", mutation_scale=13, shrinkA=gap, shrinkB=gap
    )
    arrow.set_connectionstyle(f"arc3,rad={bend}")
    arrow.set(color=colour, linewidth=1.5, linestyle=dashes)
    axes.add_patch(arrow)


def _canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Return an empty drawing, one unit to the inch."""
    figure = plt.figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
    axes.axis("off")
    return figure, axes


def draw_loop() -> Figure:
    """Draw a window's loop, and the parts that can be replaced."""
    figure, axes = _canvas(8.0, 3.1)
    policy, radio, buffers = (1.35, 2.3), (4.0, 2.3), (6.65, 2.3)
    scene, controller = (4.0, 0.75), (6.65, 0.75)
    _box(axes, policy, "policy\nwho transmits?", colour=BLUE)
    _box(axes, radio, "channel\nwho decodes whom?", colour=BLUE)
    _box(axes, buffers, "buffers\nwhat each robot knows")
    _box(axes, scene, "scene, in MuJoCo\nwhere everyone is", colour=BLUE)
    _box(axes, controller, "controller\nhow to move?", colour=BLUE)
    _arrow(axes, (2.45, 2.3), (2.9, 2.3))
    _arrow(axes, (5.1, 2.3), (5.55, 2.3))
    _arrow(axes, (6.65, 1.9), (6.65, 1.15))
    _arrow(axes, (5.55, 0.75), (5.1, 0.75))
    _arrow(axes, (4.0, 1.15), (4.0, 1.9))
    _arrow(axes, (6.2, 2.7), (1.8, 2.7), bend=0.11)
    axes.text(1.35, 0.75, "framed in blue:\nbring your own", color=BLUE, ha="center", va="center")
    return figure


def draw_window() -> Figure:
    """Draw the two protocols, slot by slot."""
    figure, axes = _canvas(8.0, 3.5)
    for left, title in ((0.2, "Request and response"), (4.2, "Two broadcasts")):
        axes.text(left + 0.55, 3.25, title, weight="bold", va="center")
        for slot, name in enumerate(("slot 1", "slot 2")):
            start = left + 0.55 + 1.5 * slot
            axes.axvspan(start, start + 1.42, 0.19, 0.8, color=LINE, alpha=0.25, linewidth=0)
            axes.text(start + 0.71, 2.95, name, color=MUTED, ha="center", va="center")
        for robot, y in enumerate((2.5, 1.75, 1.0)):
            axes.text(left + 0.32, y, f"r{robot}", ha="center", va="center")
            axes.plot((left + 0.55, left + 3.47), (y, y), color=LINE, linewidth=1, zorder=0)
        _arrow(axes, (left + 0.55, 0.45), (left + 3.5, 0.45))
        for time, x in (("0", 0.55), ("50 ms", 2.01), ("100 ms", 3.3)):
            axes.text(left + x, 0.22, time, color=MUTED, ha="center", va="center", size=9)
    _packet(axes, 0.95, 2.5, BLUE, "to r1")
    _arrow(axes, (1.3, 2.37), (1.5, 1.82), colour=BLUE)
    _arrow(axes, (1.2, 2.37), (1.5, 1.07), colour=BLUE, dashes="--")
    _packet(axes, 2.45, 1.75, ORANGE, "to r0")
    _arrow(axes, (2.8, 1.88), (3.0, 2.43), colour=ORANGE)
    _arrow(axes, (2.8, 1.62), (3.0, 1.07), colour=ORANGE, dashes="--")
    axes.text(2.21, 0.81, "dashed: overheard", color=MUTED, ha="center", va="center", size=9)
    _packet(axes, 4.95, 1.0, BLUE, "to all")
    _arrow(axes, (5.3, 1.13), (5.5, 1.68), colour=BLUE)
    _arrow(axes, (5.2, 1.13), (5.5, 2.43), colour=BLUE)
    _packet(axes, 6.45, 2.5, ORANGE, "to all")
    _arrow(axes, (6.8, 2.37), (7.0, 1.82), colour=ORANGE)
    _arrow(axes, (6.7, 2.37), (7.0, 1.07), colour=ORANGE)
    return figure


def _packet(axes: Axes, x: float, y: float, colour: str, text: str) -> None:
    block = FancyBboxPatch(
        (x - 0.1, y - 0.13), 0.75, 0.26, boxstyle="round,pad=0,rounding_size=.05"
    )
    block.set(facecolor=colour, edgecolor="none")
    axes.add_patch(block)
    axes.text(x + 0.275, y, text, color=CARD, ha="center", va="center", size=9)


def draw_sinr() -> Figure:
    """Draw where a packet decodes: alone, and beside a second transmission."""
    mission = paper("stationary", num_robots=2)
    senders = np.array([[-150.0, 0.0], [150.0, 0.0]])
    east, north = np.linspace(-450.0, 450.0, 241), np.linspace(-270.0, 270.0, 145)
    listeners = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    figure, panels = plt.subplots(1, 2, figsize=(8.0, 3.1), sharey=True)
    for panel, transmitting, title in zip(
        panels, ([0], [0, 1]), ("A transmits alone", "A and B transmit at once"), strict=True
    ):
        place = np.concatenate([senders, listeners])[None]
        recipient = np.arange(place.shape[1])[None].copy()
        recipient[0, transmitting] = BROADCAST
        heard: Int[np.ndarray, "B N"] = radio_of(mission)(place, recipient)
        for sender, pale in ((0, PALE_BLUE), (1, PALE_ORANGE)):
            decodes = (heard[0, 2:] == sender).reshape(145, 241).astype(float)
            if sender in transmitting:
                panel.contourf(east, north, decodes, levels=(0.5, 1.5), colors=[pale])
        for name, (x, y), colour in zip("AB", senders, (BLUE, ORANGE), strict=True):
            panel.plot(x, y, "o", color=colour if "AB".index(name) in transmitting else LINE)
            panel.text(x, y + 22, name, ha="center", weight="bold")
        panel.add_patch(Circle(senders[0], mission.range_m, fill=False, color=BLUE, linestyle=":"))
        panel.set(title=title, aspect="equal", xlim=(-450, 450), ylim=(-270, 270), xlabel="m")
    figure.tight_layout()
    return figure


def draw_age() -> Figure:
    """Draw how r0's news of a neighbour and of a distant teammate ages, in a real flight."""
    age, hops = _ages()
    figure, axes = plt.subplots(figsize=(8.0, 3.0))
    windows = np.arange(60, 101)
    for colour, wanted, text in (
        (BLUE, 1, "r{} is heard directly"),
        (ORANGE, 4, "r{} over 4 hops"),
    ):
        teammate = int(np.flatnonzero(hops == wanted)[0])
        axes.plot(windows, age[windows - 1, teammate], ".-", color=colour, linewidth=1.5)
        axes.text(101, age[99, teammate], text.format(teammate), color=colour, va="center")
    axes.set(xlim=(60, 101), ylim=(0, None), xlabel="window", ylabel="age of r0's news [windows]")
    figure.tight_layout()
    return figure


def _ages() -> tuple[Float[np.ndarray, "W N"], Int[np.ndarray, "N"]]:
    """Return the ages of r0's entries, window by window, and the hops of the last packets."""
    mission = paper("stationary", num_robots=20, num_windows=100)
    swarm = Swarm(mission, seeds=[1])
    ages = [
        swarm.now[0] - swarm.buffers.timestamp[0, 0].copy()
        for _ in rollout(swarm, make_policy("tdma", mission))
    ]
    parent = swarm.buffers.parent[0, 0]
    hops = np.zeros(mission.num_robots, dtype=int)
    for robot in range(1, mission.num_robots):
        place = robot
        while place > 0:
            place, hops[robot] = int(parent[place]), hops[robot] + 1
    return np.stack(ages), hops


def draw_buffer() -> Figure:
    """Draw a team of four, and what r0's buffer says about it."""
    figure, axes = _canvas(8.0, 3.0)
    places = {"r0": (0.6, 1.0), "r1": (1.6, 1.9), "r2": (2.7, 1.3), "r3": (1.85, 0.5)}
    for start, end, colour in (("r2", "r1", ORANGE), ("r1", "r0", BLUE), ("r3", "r0", BLUE)):
        _arrow(axes, places[start], places[end], colour=colour, gap=17)
    for name, place in places.items():
        axes.add_patch(Circle(place, 0.2, facecolor=CARD, edgecolor=INK, linewidth=1.5, zorder=3))
        axes.text(*place, name, ha="center", va="center", size=9, zorder=4)
    axes.text(1.65, 2.65, "r2's news reaches r0 over r1", color=MUTED, ha="center", va="center")
    rows = (
        ("robot", "observed at", "where it was then", "parent", "age now"),
        ("r0", "90", "(-150, 30) m", "-", "0"),
        ("r1", "88", "(25, 188) m", "r0", "2"),
        ("r2", "85.5", "(217, 82) m", "r1", "4.5"),
        ("r3", "81", "(69, -58) m", "r0", "9"),
    )
    axes.text(5.6, 2.65, "r0's buffer after window 90", weight="bold", ha="center", va="center")
    for y, row in zip((2.2, 1.75, 1.35, 0.95, 0.55), rows, strict=True):
        for x, cell in zip((3.7, 4.5, 5.75, 6.85, 7.5), row, strict=True):
            colour = MUTED if row is rows[0] else INK
            axes.text(x, y, cell, color=colour, ha="center", va="center", size=9)
    axes.plot((3.4, 7.85), (1.98, 1.98), color=LINE, linewidth=1)
    return figure


DIAGRAMS: dict[str, Callable[[], Figure]] = {
    "loop": draw_loop,
    "window": draw_window,
    "sinr": draw_sinr,
    "buffer": draw_buffer,
    "age": draw_age,
}

if __name__ == "__main__":
    sys.exit(script(Options, run))
