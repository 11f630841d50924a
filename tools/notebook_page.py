"""A notebook as a page of the documentation, with what its cells show when they are run now."""

import base64
import io
import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import av
import nbformat
from nbclient import NotebookClient

from swarm_mj.replay.rendering.opengl import make_context

TIMEOUT_S = 110  # of a cell
RENDERS = "renders"  # the tag of cells that need OpenGL


@cache
def page_of(path: Path) -> str:
    """Return a notebook in Markdown; it is run once a process.

    Where no OpenGL works, cells that render are shown without being run.

    Args:
        path: The notebook.

    Returns:
        Its texts, its code and what the code shows.

    Raises:
        CellExecutionError: A cell fails.
        CellTimeoutError: A cell takes too long.
    """
    notebook = nbformat.read(path, as_version=4)
    if not can_render():
        for cell in notebook.cells:
            if RENDERS in cell.metadata.get("tags", ()):
                cell.cell_type, cell.source = "markdown", f"```python\n{cell.source}\n```"
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook,
            timeout=TIMEOUT_S,
            extra_arguments=["--log-level=ERROR"],
            resources={"metadata": {"path": folder}},
        )
        client.execute()
    return "\n\n".join(part for cell in notebook.cells for part in _parts(cell))


def can_render() -> bool:
    """Return whether OpenGL works here."""
    try:
        make_context(8, 8).free()
    except OSError:
        return False
    return True


def _parts(cell: Any) -> list[str]:  # noqa: ANN401 - a notebook's node
    if cell.cell_type == "markdown":
        return [cell.source]
    outputs = [each for each in cell.outputs if each.get("name") != "stderr"]  # progress bars
    return [f"```python\n{cell.source}\n```", *map(_shown, outputs)]


def _shown(output: Any) -> str:  # noqa: ANN401 - a notebook's node
    """Return an output in the richest form that a page can have."""
    if output.output_type == "stream":
        return FORMS["text/plain"](output.text)
    best = next(form for form in FORMS if form in output.data)
    return FORMS[best](output.data[best])


def _with_poster(html: str) -> str:
    """Give an embedded film its middle picture to show until it plays."""
    found = FILM.search(html)
    if found is None:
        return html
    with av.open(io.BytesIO(base64.b64decode(found[1])), "r") as film:
        frames = [frame.to_image() for frame in film.decode(video=0)]
    poster = io.BytesIO()
    frames[len(frames) // 2].save(poster, format="jpeg", quality=80)
    picture = base64.b64encode(poster.getvalue()).decode()
    return html.replace("<video", f'<video poster="data:image/jpeg;base64,{picture}"', 1)


FILM = re.compile(r'src="data:video/mp4;base64,([^"]+)"')
FORMS: dict[str, Callable[[str], str]] = {  # the first that there is, is shown
    "text/html": lambda html: f'<div class="output">\n{_with_poster(html)}\n</div>',
    "image/png": lambda png: f'<img alt="" src="data:image/png;base64,{"".join(png.split())}">',
    "text/plain": lambda text: f"```text\n{text}\n```",
}
