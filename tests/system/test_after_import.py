"""What is done once a library is there, and only then."""

import importlib.util
import sys

import pytest

from swarm_mj.system.after_import import after_import


@pytest.fixture
def library(tmp_path, monkeypatch):
    """The name of a module that nobody has imported yet."""
    (tmp_path / "awaited_library.py").write_text("value = 3\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "meta_path", sys.meta_path[:])
    yield "awaited_library"
    sys.modules.pop("awaited_library", None)


def test_it_is_done_once_when_the_library_has_been_imported(library):
    seen = []
    after_import(library, lambda: seen.append(sys.modules[library].value))
    importlib.import_module("json")
    assert seen == []
    importlib.import_module(library)
    importlib.import_module(library)
    assert seen == [3]


def test_it_is_done_at_once_if_the_library_is_there(library):
    importlib.import_module(library)
    seen = []
    after_import(library, lambda: seen.append("now"))
    assert seen == ["now"]


def test_a_library_that_is_not_installed_is_missing_as_ever(monkeypatch):
    monkeypatch.setattr(sys, "meta_path", sys.meta_path[:])
    seen = []
    after_import("no_such_library", lambda: seen.append("never"))
    with pytest.raises(ModuleNotFoundError, match="no_such_library"):
        importlib.import_module("no_such_library")
    assert seen == []


def test_looking_for_the_library_imports_nothing(library):
    seen = []
    after_import(library, lambda: seen.append(library))
    assert importlib.util.find_spec(library) is not None
    assert seen == []
    importlib.import_module(library)
    assert seen == [library]


def test_modules_of_a_namespace_package_are_found(tmp_path, monkeypatch):
    """Its path is Python's own kind of list, not a sequence."""
    (tmp_path / "spread_out").mkdir()
    (tmp_path / "spread_out" / "part.py").write_text("value = 4\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "meta_path", sys.meta_path[:])
    after_import("no_such_library", lambda: None)
    assert importlib.import_module("spread_out.part").value == 4
    sys.modules.pop("spread_out.part")
    sys.modules.pop("spread_out")
