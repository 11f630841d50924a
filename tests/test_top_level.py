"""The names at the top: what there is, what is loaded, and what type checkers see."""

import ast
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


@pytest.mark.parametrize(
    "before", ["pass", "import swarm_mj.rollout", "swarm_mj.summarise", "swarm_mj.rollout"]
)
def test_rollout_can_be_called_whatever_was_imported_before(before):
    """A module has the same name, and Python puts it there when it is imported."""
    code = f"""
import swarm_mj
{before}
mission = swarm_mj.paper("stationary", num_robots=3, num_windows=4, range_ratio=5.0)
policy = swarm_mj.make_policy("tdma", mission)
flown = list(swarm_mj.rollout(swarm_mj.Swarm(mission, [1]), policy))
from swarm_mj import rollout
flown += rollout(swarm_mj.Swarm(mission, [1]), policy)
from swarm_mj.rollout import rollout
flown += rollout(swarm_mj.Swarm(mission, [1]), policy)
print(len(flown))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("12\n", "")
