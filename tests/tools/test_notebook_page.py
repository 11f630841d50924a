"""Notebooks as pages: texts, code and what the code shows; a cell that fails fails the page."""

import base64
import io
import re

import nbformat
import numpy as np
import pytest
from nbclient.exceptions import CellExecutionError
from notebook_page import page_of
from PIL import Image

from swarm_mj.replay.rendering.video import encode_mp4
from swarm_mj.replay.view import VideoStyle

CELLS = {
    "both": "print('said')\n1 + 1",
    "table": "from IPython.display import HTML\nHTML('<b>seven</b>')",
    "chart": "import matplotlib.pyplot as plt\nplt.plot([1, 2]);",
}


def notebook(path, *codes):
    cells = [nbformat.v4.new_markdown_cell("# A title")]
    cells += [nbformat.v4.new_code_cell(code) for code in codes]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), path)
    return path


@pytest.mark.slow
def test_a_page_has_text_code_and_outputs_in_order(tmp_path):
    page = page_of(notebook(tmp_path / "a.ipynb", *CELLS.values()))
    expected = [
        "# A title",
        CELLS["both"],
        "```text\nsaid",
        "```text\n2\n```",
        "<b>seven</b>",
        "image/png",
    ]
    places = [page.index(each) for each in expected]
    assert places == sorted(places)


def test_without_opengl_cells_that_render_are_not_run(tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "off")
    path = notebook(tmp_path / "a.ipynb", "1 / 0", "1 + 1")
    written = nbformat.read(path, as_version=4)
    written.cells[1].metadata["tags"] = ["renders"]
    nbformat.write(written, path)
    assert "```python\n1 / 0\n```" in page_of(path)


def test_a_cell_that_fails_is_an_error(tmp_path):
    with pytest.raises(CellExecutionError, match="division by zero"):
        page_of(notebook(tmp_path / "a.ipynb", "1 / 0"))


@pytest.mark.slow
def test_a_film_shows_its_middle_until_it_plays(tmp_path):
    """Ten pictures, each brighter than the one before."""
    pictures = (np.full((64, 64, 3), 25 * k, np.uint8) for k in range(10))
    film = encode_mp4(pictures, VideoStyle(width=64, height=64, seconds=1.0, fps=10))
    (tmp_path / "a.mp4").write_bytes(film)
    how = "embed=True, mimetype='video/mp4'"
    path = tmp_path / "a.mp4"
    page = page_of(
        notebook(
            tmp_path / "a.ipynb", f"from IPython.display import Video\nVideo({str(path)!r}, {how})"
        )
    )
    (poster,) = re.findall(r'<video poster="data:image/jpeg;base64,([^"]+)"', page)
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(poster))).convert("L"), float)
    assert shown.mean() == pytest.approx(125.0, abs=8.0)
