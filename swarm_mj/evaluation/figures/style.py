"""One style for all figures: each method's colour and marker, type, and captions in files.

Hues are Okabe and Ito's and Tol's, which remain distinct for colour-blind readers; markers differ
too. Our curves are solid and filled, published ones dashed and hollow, in the same colour. The
oracle, which no team could fly, is black and thin.
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
    "greedy-oracle": Look(label="greedy oracle", colour="#000000", marker=".", size=5.0, width=0.8),
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
    """Return the look of a policy or a published method; one without a look is grey."""
    return LOOKS.get(method, Look(label=escape_mathtext(method), colour=FAINT, marker="d"))


def escape_mathtext(text: str) -> str:
    """Escape a text for matplotlib, in which dollars begin a formula."""
    return text.replace("$", r"\$")


def styled() -> AbstractContextManager[None]:
    """Apply this style within a context, regardless of the user's settings."""
    return matplotlib.style.context(["default", RC])


def write_caption(figure: Figure, x: float, y: float, text: str) -> None:
    """Write the origin of a figure's numbers, in small type."""
    figure.text(x, y, escape_mathtext(text), fontsize=7, color=FAINT, gid=CAPTION)


def save(figure: Figure, path: Path) -> None:
    """Write a figure, with its caption in the metadata; the same figure gives the same bytes.

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
