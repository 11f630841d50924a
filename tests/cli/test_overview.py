"""The line without a command: overview, likely names."""

import pytest

from swarm_mj.cli import COMMANDS, main
from swarm_mj.cli.overview import BEGINNING


def test_nothing_typed_shows_where_to_begin(capsys):
    assert main([]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    for name, summary in COMMANDS.items():
        assert f"  {name} " in printed.err
        assert summary in printed.err
    assert "swarm-mj fly " in printed.err
    assert max(map(len, printed.err.splitlines())) <= 80


def test_the_commands_to_begin_with_exist():
    assert {line.split()[0] for line in BEGINNING} <= set(COMMANDS)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("flyy", "swarm-mj: error: there is no command 'flyy'; did you mean fly?"),
        ("xyz", "swarm-mj: error: there is no command 'xyz' (see"),
        ("--versoin", "did you mean --version?"),
        ("fly --polcy tdma", "unrecognized arguments: --polcy tdma; did you mean --policy?"),
        ("fly --polcy=tdma", "did you mean --policy?"),
        ("fly --task flok", "task must be one of"),
        ("fly --task flok", "not 'flok'; did you mean flocking?"),
        ("train --out r --arm tem", "did you mean team?"),
        ("--print-completion fish", "invalid choice: 'fish'"),
    ],
)
def test_a_slip_is_answered_with_the_likely_name(capsys, line, complaint):
    assert main(line.split()) == 2
    printed = capsys.readouterr().err
    assert complaint in printed
    assert len(printed.splitlines()) == 1
