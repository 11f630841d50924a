"""Completion, as bash asks for it."""

import shutil
import subprocess

import pytest

from swarm_mj.cli import COMMANDS
from swarm_mj.cli.completion import completion

ASK = """
source "$1"; shift
COMP_WORDS=(swarm-mj "$@"); COMP_CWORD=$#; COMPREPLY=()
_shtab_swarm_mj swarm-mj "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD-1]}"
printf "%s\\n" "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    path = tmp_path_factory.mktemp("completion") / "swarm-mj"
    path.write_text(completion("bash"))
    return path


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ([""], set(COMMANDS)),
        (["f"], {"fly", "figures"}),
        (["fly", "--rob"], {"--robots"}),
        (["fly", "--task", ""], {"stationary", "random-walk", "flocking", "formation", "coverage"}),
        (["fly", "--policy", "g"], {"gossip", "greedy-oracle", "gnn"}),
        (["fly", "--policy", "ru"], {"runs"}),
        (["evaluate", "--policy", "tdma", "al"], {"all", "aloha"}),
        (["evaluate", "--task", "flocking", "st"], {"stationary"}),
        (["train", "--arm", ""], {"robot", "team"}),
        (["replay", "so"], {"some.rrd"}),
        (["replay", "some.rrd", "s"], {"some.rrd", "studies"}),
        (["figures", "s"], {"some.csv", "studies"}),
        (["fly", "--json", "so"], {"some.rrd", "some.csv"}),
        (["policies", "spa"], {"spatial-tdma"}),
    ],
)
def test_bash_completes(script, tmp_path, typed, offered):
    (tmp_path / "some.rrd").touch()
    (tmp_path / "some.csv").touch()
    (tmp_path / "studies").mkdir()
    (tmp_path / "runs").mkdir()
    asked = ["bash", "-c", ASK, "bash", str(script), *typed]
    done = subprocess.run(asked, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == offered


def test_zsh_is_told_the_same_names():
    said = completion("zsh")
    assert said.startswith("#compdef swarm-mj")
    for words in (
        "(stationary random-walk flocking formation coverage)",
        "compadd random-flooding",
        "_files -/",
        "_files -g '*.rrd'",
    ):
        assert words in said


def test_the_command_prints_it(swarm_mj):
    done = swarm_mj("--print-completion", "bash")
    assert done.returncode == 0
    assert done.stdout == completion("bash")
