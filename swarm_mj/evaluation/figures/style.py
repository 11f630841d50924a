"""One style for all figures: each method's colour and marker, type, and captions in files.

Hues are Okabe and Ito's and Tol's, which remain distinct for colour-blind readers; markers differ
too. Our curves are solid and filled, published ones dashed and hollow, in the same colour. The
oracles, which no team could fly, are thin.
"""

import io
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import cast

import matplotlib.pyplot as plt
import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from swarm_mj.policies.about import Look
from swarm_mj.policies.registry import LISTED, about_of
from swarm_mj.system.interrupt import raise_if_interrupted
from swarm_mj.system.writing import Output, check_outputs, write_bytes

WIDTH_IN = 7.5  # shown at 900 pixels, a point of type is 1.7 pixels
TITLE_PT = 10.0
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


# The GNN and its variants, of which no figure shows all: some look like others of other figures.
GNN = Look(label="GNN", colour="#cc79a7", marker="X")
VARIANT = Look(label="GNN, linear", colour="#5e16d8", marker="p")
REWARDED = Look(label="GNN, shared reward", colour="#180048", marker="H")
# What is no policy of the package, by its name in results and published tables.
OTHERS = {
    "training.ceiling:Annealed": Look(
        label="searched schedule", colour="#0000ff", marker=".", marker_size=5.0, line_width=0.8
    ),
    "floor": Look(
        label="proven floor", colour="#cccccc", marker="_", marker_size=6.0, line_width=2.5
    ),
    "perfect knowledge": Look(
        label="perfect knowledge", colour="#b3b3b3", marker="_", marker_size=4.0, line_width=1.0
    ),
    "GNN": GNN,
    "linear GNN": VARIANT,
    "GNN generalized from 0.25": replace(VARIANT, label="GNN, from 0.25"),
    "GNN trained at each size": replace(GNN, label="GNN, each size"),
    "GNN generalized from 40": replace(VARIANT, label="GNN, from 40"),
    BETTER: replace(GNN, label="the paper's GNN"),
    "one GNN": replace(REWARDED, label="one GNN for all"),
    "GNN on turns": replace(REWARDED, label="GNN, turns"),
    "linear GNN on turns": Look(label="GNN, linear, turns", colour="#7a7a00", marker="h"),
    "GNN with shared reward": REWARDED,
    "GNN with credit per robot": replace(REWARDED, label="GNN, own credit"),
    "GNN trained on AoI": replace(GNN, label="GNN, on AoI"),
    "GNN trained on velocity variance": replace(VARIANT, label="GNN, on variance"),
}
LOOKS = {name: about.look for name, about in LISTED.items()} | OTHERS


def look_of(method: str) -> Look:
    """Return how a method looks in every figure.

    Args:
        method: A policy's name, or a published method's. That of a policy of a user's own counts
            where this process has loaded it, and it declares a look.

    Returns:
        The look; a method that declares none is grey, under its name.
    """
    if method in LOOKS:
        return LOOKS[method]
    about = about_of(method)
    if about is None:
        return Look(label=escape_mathtext(method), colour=FAINT, marker="d")
    return replace(about.look, label=escape_mathtext(about.look.label))


def escape_mathtext(text: str) -> str:
    """Escape a text for matplotlib, in which dollars begin a formula."""
    return text.replace("$", r"\$")


def styled() -> AbstractContextManager[None]:
    """Apply this style within a context, regardless of the user's settings."""
    return matplotlib.style.context(["default", "swarm_mj.evaluation.figures.paper"])


def panels(title: str, *, rows: int, height_in: float) -> tuple[Figure, list[Axes]]:
    """Return a titled figure of panels below each other, over one x."""
    figure = plt.figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    axes = figure.subplots(rows, 1, sharex="col", squeeze=False)
    figure.suptitle(escape_mathtext(title), x=0.01, ha="left", fontsize=TITLE_PT)
    return figure, list(axes.flat)


def kept(figure: Figure) -> Figure:
    """Return a figure as a function hands it back, in a notebook too."""
    # A notebook shows a figure twice if it is open and a cell's result.
    if "inline" in str(plt.get_backend()):
        plt.close(figure)
    return figure


def write_caption(figure: Figure, text: str, x: float = 0.01, y: float | None = None) -> None:
    """Write the origin of a figure's numbers, in small type.

    Args:
        figure: Whose numbers they are.
        text: The origin, in one line or more.
        x: Where it begins, a share of the figure's width.
        y: Where it stands, a share of the height; None leaves room for it to the figure's layout.
    """
    look = {"fontsize": 7, "color": FAINT, "ha": "left"}
    figure.supxlabel(escape_mathtext(text), x=x, y=y, gid=CAPTION, **look)


def code(version: str, *commits: str | None) -> str:
    """Return what made a figure's numbers, for its caption.

    Args:
        version: Of the package.
        *commits: Of the code, in full, each named once; `+` at the end says that files had been
            changed since. None is unknown, and is left out.
    """
    known: dict[str, None] = {}  # each once, in order
    for commit in commits:
        if commit:
            changed = "+" if commit.endswith("+") else ""
            known[f"{commit[:SHORT]}{changed}"] = None
    if not known:
        return f"swarm_mj {version}"
    noun = "commit" if len(known) == 1 else "commits"
    return f"swarm_mj {version}, {noun} {', '.join(known)}"


def draw_to(out: Path, draw: Callable[[], Figure]) -> None:
    """Draw a figure and write it as SVG and as PNG, once it is known that both can be written.

    Args:
        out: The files, without their endings; they are replaced if they exist.
        draw: Returns the figure, with its caption from `write_caption`.

    Raises:
        ValueError: A file's place is no place for a file.
        OSError: A file cannot be written.
    """
    paths = [out.with_name(f"{out.name}.{kind}") for kind in ("svg", "png")]
    check_outputs(*(Output("figure", path) for path in paths))
    figure = draw()
    for path in paths:
        save(figure, path)


def save(figure: Figure, path: Path) -> None:
    """Write a figure, always the same bytes, with its caption as metadata.

    Args:
        figure: It has had its caption from `write_caption`.
        path: Ends in one of `METADATA`, and is replaced if it exists.

    Raises:
        OSError: The file cannot be written.
        KeyboardInterrupt: Ctrl-C was pressed while the figure was drawn.
    """
    kind = path.suffix.removeprefix(".").lower()
    field, undated = METADATA[kind]
    [caption] = figure.findobj(lambda artist: artist.get_gid() == CAPTION)
    drawn = io.BytesIO()
    with styled():
        metadata = {field: cast(Text, caption).get_text(), **undated}
        colour = figure.get_facecolor()
        figure.savefig(drawn, format=kind, facecolor=colour, metadata=metadata)
    raise_if_interrupted()  # matplotlib swallows it while it loads
    write_bytes(path, drawn.getbuffer())
