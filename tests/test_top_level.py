"""The names at the top: what there is, what is loaded, and what type checkers see."""

import ast
import re
import subprocess
import sys
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


def run(*arguments):
    """What a fresh Python prints."""
    command = [sys.executable, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout + done.stderr


def test_the_stub_names_each_once_and_re_exports_it():
    """Each line is `from ... import X as X`, without which X is not public to type checkers."""
    tree = ast.parse(Path(swarm_mj.__file__).with_suffix(".pyi").read_text("utf-8"))
    aliases = []
    for node in tree.body:
        if isinstance(node, ast.ImportFrom):
            aliases += node.names
    assert sorted(each.name for each in aliases) == swarm_mj.__all__
    assert all(each.asname == each.name for each in aliases)


def test_importing_the_package_loads_no_library():
    """Not even NumPy: `import swarm_mj` takes no time, and `swarm-mj --help` neither."""
    code = "import swarm_mj, sys; print(sorted({'gymnasium', 'numpy', 'torch'} & {*sys.modules}))"
    assert run("-c", code) == "[]\n"


def test_the_list_of_policies_needs_neither_torch_nor_gymnasium():
    """Whatever options Python itself is given."""
    said = run("-X", "importtime", "-m", "swarm_mj", "policies")
    loaded = set(re.findall(r"\| +(\w+)$", said, re.MULTILINE))
    assert "numpy" in loaded
    assert not loaded & {"gymnasium", "torch"}


@pytest.mark.parametrize("order", ["swarm_mj, gymnasium", "gymnasium, swarm_mj"])
def test_gymnasium_knows_the_environments_whichever_is_imported_first(order):
    code = f"import {order}; print('swarm_mj/Flocking-v0' in gymnasium.registry)"
    assert run("-c", code) == "True\n"
