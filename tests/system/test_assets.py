"""Files and folders that the package brings."""

import pytest

from swarm_mj.system.assets import asset


def test_files_and_folders_are_found():
    assert asset("arena.xml").is_file()
    assert asset("policies/gnn.safetensors").is_file()


def test_what_is_missing_is_named():
    with pytest.raises(FileNotFoundError, match=r"asset gone\.xml is neither in the package nor"):
        asset("gone.xml")
