"""One style for all figures: each method's colour and marker, type, and what files say of it.

Hues are Okabe and Ito's and Tol's, which stay apart for colour-blind eyes; markers differ too. Ours
is solid and filled, what the paper published dashed and hollow, in the same colour. The oracle,
which no team could fly, is black and thin.
"""

import io
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import matplotlib.style
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text

from swarm_mj.policies.registry import WITHOUT_PAYLOAD
from swarm_mj.system.atomic import write_bytes

WIDTH_IN = 7.5  # shown at 900 pixels, a point of type is 1.7 pixels
DPI = 240
INK, FAINT, GRID = "#222222", "#666666", "#e4e4e4"
RAMP = "viridis"

RC = {
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.minor.bottom": False,
    "ytick.minor.left": False,
    "lines.linewidth": 1.4,
    "savefig.dpi": DPI,
    "savefig.facecolor": "white",
    "svg.hashsalt": "swarm_mj",  # the same figure is the same file
}
# The field that has a format's caption, and those that would say when the file was made.
METADATA = {
    "svg": ("Description", {"Date": None}),
    "png": ("Description", {}),
    "pdf": ("Subject", {"CreationDate": None}),
}
CAPTION = "caption"  # the name of the text that files also have among their own descriptions


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a method looks in every figure."""

    label: str
    colour: str
    marker: str
    size: float = 4.5  # of the marker [pt]
    width: float = 1.4  # of the line [pt]

    @property
    def ink(self) -> tuple[float, ...]:
        """The colour for type, which is thin: darker."""
        return tuple(0.7 * share for share in to_rgb(self.colour))


LOOKS = {
    "random-flooding": Look(label="random flooding", colour="#e69f00", marker="o"),
    "round-robin": Look(label="round robin", colour="#56b4e9", marker="s"),
    "mst": Look(label="MST", colour="#009e73", marker="^"),
    "aloha": Look(label="slotted ALOHA", colour="#999933", marker="v"),
    "gossip": Look(label="gossip", colour="#882255", marker="P", size=5.0),
    "tdma": Look(label="TDMA", colour="#0072b2", marker="D", size=4.0),
    "spatial-tdma": Look(label="spatial TDMA", colour="#332288", marker="h", size=5.5),
    "planner": Look(label="planner", colour="#80391e", marker="d"),
    WITHOUT_PAYLOAD: Look(label="planner, no payload", colour="#a6d854", marker="<"),
    "gnn": Look(label="gnn (T, M, P only)", colour="#d55e00", marker="*", size=8.0),
    "greedy-oracle": Look(
        label="oracle (knows all)", colour="#000000", marker=".", size=5.0, width=0.8
    ),
    "GNN": Look(label="GNN", colour="#cc79a7", marker="X"),
    "linear GNN": Look(label="GNN, linear", colour="#b3589a", marker="p"),
    "GNN generalized from 0.25": Look(label="GNN, from 0.25", colour="#b3589a", marker="p"),
    "GNN trained at each size": Look(label="GNN, each size", colour="#cc79a7", marker="X"),
    "GNN generalized from 40": Look(label="GNN, from 40", colour="#b3589a", marker="p"),
    "GNN with shared reward": Look(label="GNN, shared reward", colour="#5e16d8", marker="H"),
    "GNN with credit per robot": Look(label="GNN, own credit", colour="#5e16d8", marker="H"),
    "GNN trained on AoI": Look(label="GNN, on AoI", colour="#cc79a7", marker="X"),
    "GNN trained on velocity variance": Look(
        label="GNN, on variance", colour="#b3589a", marker="p"
    ),
}


def look_of(method: str) -> Look:
    """A policy's or a published method's look; one that has none yet is grey, under its name."""
    return LOOKS.get(method, Look(label=as_it_is(method), colour=FAINT, marker="d"))


def as_it_is(text: str) -> str:
    """Return a text of others as matplotlib draws it as it is: dollars do not begin a formula."""
    return text.replace("$", r"\$")


def styled() -> AbstractContextManager[None]:
    """Within it, everything is drawn in this style, whatever the user's own settings."""
    return matplotlib.style.context(["default", RC])


def write_caption(figure: Figure, x: float, y: float, text: str) -> None:
    """Write where a figure's numbers come from, small, from a place on the figure on."""
    figure.text(x, y, as_it_is(text), fontsize=7, color=FAINT, gid=CAPTION)


def save(figure: Figure, path: Path) -> None:
    """Write a figure, its caption among the file's own data; the same figure gives the same bytes.

    Args:
        figure: Drawn in this style, with a caption.
        path: The file, replaced if it exists; its ending is one of `FORMATS`.

    Raises:
        OSError: The file cannot be written.
    """
    kind = path.suffix.removeprefix(".")
    field, undated = METADATA[kind]
    caption = next(
        text.get_text()
        for text in figure.findobj(Text)
        if isinstance(text, Text) and text.get_gid() == CAPTION
    )
    drawn = io.BytesIO()
    with styled():
        figure.savefig(drawn, format=kind, metadata={field: caption, **undated})
    write_bytes(path, drawn.getbuffer())
