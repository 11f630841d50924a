"""The words beside a picture's map: the title, the time, the ramp of ages and the legend."""

import textwrap
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from swarm_mj.evaluation.figures.style import CAPTION, escape_mathtext
from swarm_mj.radio.words import where_flown
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage
from swarm_mj.system.packages import version

# The picture, with `picture.py`'s map on its left.
WIDTH_IN = 12.8
HEIGHT_IN = 7.2
BOTTOM_IN = 0.6
TEXT_IN = 7.75  # where what is written begins
RAMP_IN = 4.4  # how long the ramp of ages is
RAMP_ROOM_IN = 0.75  # from the text's last line to the ramp's lower edge, its title between
# Sizes of type.
LARGE_PT = 22.0
TEXT_PT = 13.0
SMALL_PT = 10.5
LINE = 1.45  # of a line's height, by the size of its type
CHARACTERS = 52  # of a line
POINTS_PER_IN = 72.0


def share(
    left_in: float, bottom_in: float, width_in: float, height_in: float
) -> tuple[float, float, float, float]:
    """Return a place on the picture as matplotlib takes it: by the picture's width and height."""
    return (
        left_in / WIDTH_IN,
        bottom_in / HEIGHT_IN,
        width_in / WIDTH_IN,
        height_in / HEIGHT_IN,
    )


def rgb(colour: palette.Colour) -> str:
    """Return a colour as matplotlib takes it, such as #ff8000."""
    return f"#{bytes(colour).hex()}"


class _Line(NamedTuple):
    """A line of text beside the map."""

    text: str
    size_pt: float
    colour: palette.Colour


def _lines(footage: Footage, row: int) -> list[_Line]:
    """Return title, mission and time."""
    facts = footage.facts
    mission = facts.mission
    lines = [_Line(facts.policy or "a mission", LARGE_PT, palette.TEXT)]
    about = f"{mission.task}, {mission.num_robots} robots, seed {facts.seed}"
    lines += [_Line(each, TEXT_PT, palette.TEXT) for each in textwrap.wrap(about, CHARACTERS)]
    where = ", ".join([*where_flown(mission), *facts.own_parts])
    wrapped = textwrap.wrap(where, CHARACTERS, break_on_hyphens=False)
    lines += [_Line(each, SMALL_PT, palette.SENT) for each in wrapped]
    now = footage.window[row]
    time = f"{now * mission.window_s:.1f} s, window {now} of {mission.num_windows}"
    lines.append(_Line(time, TEXT_PT, palette.TEXT))
    if np.isfinite(footage.age_mean[row]):
        age = f"mean age of information: {footage.age_mean[row]:.1f} windows"
        lines.append(_Line(age, TEXT_PT, palette.MEAN_AGE))
    return lines


def write_text(figure: Figure, footage: Footage, row: int) -> float:
    """Write title and time beside the map; return how high the last line stands [in]."""
    x = TEXT_IN / WIDTH_IN
    y_in = HEIGHT_IN - 0.3
    for line in _lines(footage, row):
        y_in -= LINE * line.size_pt / POINTS_PER_IN
        text = escape_mathtext(line.text)
        colour = rgb(line.colour)
        figure.text(x, y_in / HEIGHT_IN, text, fontsize=line.size_pt, color=colour)
    made_by = f"swarm_mj {version()}"
    colour = rgb(palette.WALL)
    figure.text(x, BOTTOM_IN / HEIGHT_IN, made_by, fontsize=8.0, color=colour, gid=CAPTION)
    return y_in


def draw_ramp(figure: Figure, footage: Footage, below_in: float) -> None:
    """Draw what colour stands for what age, below a height on the picture [in]."""
    full = footage.facts.full_scale
    axes = figure.add_axes(share(TEXT_IN, below_in - RAMP_ROOM_IN, RAMP_IN, 0.2))
    ages = np.linspace(0.0, full, 256)
    axes.imshow(palette.age_colours(ages, full)[None], aspect="auto", extent=(0.0, full, 0.0, 1.0))
    title = f"age of what r{footage.ego} knows of a robot [windows]"
    axes.set_title(title, fontsize=TEXT_PT, color=rgb(palette.TEXT))
    axes.set_xticks([0.0, full / 2.0, full], ["0", f"{full / 2.0:g}", f"{full:g} or more"])
    axes.tick_params(colors=rgb(palette.WALL), labelcolor=rgb(palette.SENT), labelsize=SMALL_PT)
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)


def draw_legend(figure: Figure, shown: list[Line2D], below_in: float) -> None:
    """Name what is drawn, by its samples, below a height on the picture [in]."""
    figure.legend(
        handles=shown,
        loc="upper left",
        bbox_to_anchor=((TEXT_IN - 0.05) / WIDTH_IN, (below_in - 0.4) / HEIGHT_IN),
        frameon=False,
        fontsize=TEXT_PT,
        labelcolor=rgb(palette.SENT),
        borderpad=0.0,
        borderaxespad=0.0,
        labelspacing=0.6,
    )
