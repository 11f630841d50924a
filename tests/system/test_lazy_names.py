"""Names that a stub imports are there, and each is imported when it is first asked for."""

import importlib
import sys

import pytest

from swarm_mj.system.lazy_names import imported_names

STUB = """
from lazy_package.first import one as one
from lazy_package.second import two as two

__version__: str
"""
PACKAGE = """
from swarm_mj.system.lazy_names import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two modules, each with a number."""
    folder = tmp_path / "lazy_package"
    folder.mkdir()
    (folder / "__init__.py").write_text(PACKAGE)
    (folder / "__init__.pyi").write_text(STUB)
    (folder / "first.py").write_text("one = 1\n")
    (folder / "second.py").write_text("two = 2\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("lazy_package")
    for name in [name for name in sys.modules if name.startswith("lazy_package")]:
        del sys.modules[name]


def test_a_module_is_imported_when_a_name_of_it_is_asked_for(package):
    assert package.__all__ == ["one", "two"]
    assert {"one", "two", "__file__"} <= set(dir(package))
    assert "lazy_package.second" not in sys.modules
    assert package.two == 2
    assert "lazy_package.second" in sys.modules
    assert "lazy_package.first" not in sys.modules


def test_another_name_is_unknown(package):
    with pytest.raises(AttributeError, match="module 'lazy_package' has no attribute 'three'"):
        _ = package.three


def test_what_a_stub_does_not_import_is_no_name(tmp_path):
    (tmp_path / "a.pyi").write_text(STUB)
    homes = {"one": "lazy_package.first", "two": "lazy_package.second"}
    assert imported_names(str(tmp_path / "a.pyi")) == homes
