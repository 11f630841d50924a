"""Notebooks as pages: texts, code and what the code shows; a cell that fails fails the page."""

import nbformat
import pytest
from nbclient.exceptions import CellExecutionError
from notebook_page import page_of

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
