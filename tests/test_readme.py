"""The README's Python runs, and its commands exist."""

import re
import shlex
from pathlib import Path

import pytest

from swarm_mj.cli import parse

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
COMMANDS = re.findall(r"^swarm-mj (.+)$", README, re.MULTILINE)


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs(example, capsys):
    exec(compile(example, "README.md", "exec"), {"__name__": "readme"})
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_is_understood(command):
    run, _ = parse(shlex.split(command, comments=True))
    assert callable(run)


def test_there_are_examples_and_every_file_named_in_the_map_exists():
    assert len(EXAMPLES) == 2
    assert len(COMMANDS) >= 4
    named = re.findall(r"^  ([a-z_]+(?:\.py|/))", README, re.MULTILINE)
    assert len(named) >= 14
    for name in named:
        assert (ROOT / "swarm_mj" / name).exists(), name
