"""One style for all figures: each method's colour and marker, type, and captions in files.

Hues are Okabe and Ito's and Tol's, which remain distinct for colour-blind readers; markers differ
too. Our curves are solid and filled, published ones dashed and hollow, in the same colour. The
oracle, which no team could fly, is black and thin.
"""

import io
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple, cast

import matplotlib.style
import msgspec
from matplotlib.figure import Figure
from matplotlib.text import Text

from swarm_mj.system.writing import write_bytes

WIDTH_IN = 7.5  # shown at 900 pixels, a point of type is 1.7 pixels
FAINT = "#666666"
# The field that has a format's caption, and those that would say when the file was made.
METADATA = {
    "svg": ("Description", {"Date": None}),
    "png": ("Description", {}),
    "pdf": ("Subject", {"CreationDate": None}),
}
BETTER = "GNN trained in the better of two ways"  # of the published ones, at each team size
SHORT = 7  # of a commit's digits
CAPTION = "caption"  # the name of the text that files also have among their own descriptions


class Look(NamedTuple):
    """How a method looks in every figure."""

    label: str
    colour: str
    marker: str
    size: float = 4.5  # of the marker [pt]
    width: float = 1.4  # of the line [pt]


LOOKS = msgspec.toml.decode(
    Path(__file__).with_name("looks.toml").read_bytes(), type=dict[str, Look]
)


def look_of(method: str) -> Look:
    """Return the look of a policy or a published method; one without a look is grey."""
    return LOOKS.get(method, Look(escape_mathtext(method), FAINT, "d"))


def escape_mathtext(text: str) -> str:
    """Escape a text for matplotlib, in which dollars begin a formula."""
    return text.replace("$", r"\$")


def styled() -> AbstractContextManager[None]:
    """Apply this style within a context, regardless of the user's settings."""
    return matplotlib.style.context(["default", "swarm_mj.evaluation.figures.paper"])


def write_caption(figure: Figure, text: str, x: float = 0.01, y: float | None = None) -> None:
    """Write the origin of a figure's numbers, in small type; a layout finds room for it."""
    look = {"fontsize": 7, "color": FAINT, "ha": "left"}
    figure.supxlabel(escape_mathtext(text), x=x, y=y, gid=CAPTION, **look)


def code(version: str, *commits: str | None) -> str:
    """Return what made a figure's numbers, for its caption; `+` is a commit that was changed."""
    known = dict.fromkeys(each[:SHORT] + "+" * each.endswith("+") for each in commits if each)
    noun = ", commits" if len(known) > 1 else ", commit" if known else ""
    return f"swarm_mj {version}{noun} {', '.join(known)}".rstrip()


def save(figure: Figure, path: Path) -> None:
    """Write a figure, always the same bytes, with its caption as metadata; raise OSError if not."""
    kind = path.suffix.removeprefix(".").lower()
    field, undated = METADATA[kind]
    [caption] = figure.findobj(lambda artist: artist.get_gid() == CAPTION)
    drawn = io.BytesIO()
    with styled():
        metadata = {field: cast(Text, caption).get_text(), **undated}
        colour = figure.get_facecolor()
        figure.savefig(drawn, format=kind, facecolor=colour, metadata=metadata)
    write_bytes(path, drawn.getbuffer())
