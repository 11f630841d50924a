"""The names at the top: what there is, what is loaded, and what type checkers see."""

import ast
from pathlib import Path

import pytest

import swarm_mj


def test_every_name_is_there():
    for name in swarm_mj.__all__:
        assert getattr(swarm_mj, name) is not None
        assert name in dir(swarm_mj)
    assert swarm_mj.__version__.count(".") == 2
    with pytest.raises(AttributeError, match="has no attribute 'flyy'"):
        _ = swarm_mj.flyy


def test_type_checkers_are_told_of_the_same_names():
    tree = ast.parse(Path(swarm_mj.__file__).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    told = {
        (node.module.removeprefix("swarm_mj."), alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    homes = {(home, name) for home, names in swarm_mj._HOMES.items() for name in names}
    assert told == homes
    assert sorted(name for _, name in homes) == sorted(swarm_mj.__all__)
