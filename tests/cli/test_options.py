"""A dataclass as a command line, shown in small; every command's help fits and says all."""

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from swarm_mj.cli import COMMANDS, main
from swarm_mj.cli.options import parse_options
from swarm_mj.policies.registry import POLICIES
from swarm_mj.system.fields import setting


@dataclass(frozen=True, kw_only=True)
class Picnic:
    """Some options."""

    guests: tuple[str, ...] = setting(help="who comes", is_positional=True, metavar="WHO")
    num_cakes: int = setting(2, "how many", unit="cakes", low=1, high=9)
    hours: float | None = setting(None, "how long", low=0.5, high=8.0, shown="until it rains")
    sizes: tuple[int, ...] = setting((1, 2), "of the cakes", low=1, high=3)
    is_vegan: bool = setting(False, "100 % plants")
    drink: str = setting(
        "tea",
        "what there is",
        choices=("tea", "juice"),
        group="drinks",
        one_only="one drink a picnic",
    )
    place: Path = setting(help="where", metavar="MEADOW")
    typed: tuple[str, ...] = ()
    note: int = 7  # no help, no option


def picnic(*arguments):
    return parse_options(Picnic, arguments, "picnic", "Have a picnic.")


def test_defaults_are_the_dataclasss_and_flags_may_be_cut_short():
    typed = ("ann", "--pl", "p")
    assert picnic(*typed) == Picnic(guests=("ann",), place=Path("p"), typed=typed)


def test_every_kind_of_value_is_read():
    line = "ann bob --cakes 9 --hours 0.5 --sizes 3 1 --sizes 2 --vegan --drink juice --place a/b"
    assert picnic(*line.split()) == Picnic(
        guests=("ann", "bob"), num_cakes=9, hours=0.5, sizes=(3, 1, 2), is_vegan=True,
        drink="juice", place=Path("a/b"), typed=tuple(line.split()),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("--cakes 10", "--cakes must be a whole number from 1 to 9 [cakes], not 10"),
        ("--hours nan", "--hours must be a number from 0.5 to 8, not nan"),
        ("--sizes 1 4", "--sizes must be a whole number from 1 to 3, not 4"),
        ("--drink wine", "--drink must be one of tea, juice, not 'wine'"),
    ],
)
def test_values_out_of_range_are_refused(arguments, complaint):
    with pytest.raises(ValueError, match="must be") as refusal:
        picnic("ann", "--place", "p", *arguments.split())
    assert str(refusal.value) == complaint


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("ann", "the following arguments are required: --place"),
        ("--place p", "the following arguments are required: WHO"),
        (
            "ann --place p --cakes many",
            "argument --cakes: name a whole number from 1 to 9 [cakes], not 'many'",
        ),
        ("ann --place p --hours long", "argument --hours: name a number from 0.5 to 8, not 'long'"),
        ("ann --place p --drink tea juice", "unrecognized arguments: juice; one drink a picnic"),
        ("ann --place p --vegan juice --fog", "unrecognized arguments: juice --fog"),
        ("ann --place p --fog", "unrecognized arguments: --fog"),
        (
            "ann --place p --cake 3 --drnk tea",
            "unrecognized arguments: --drnk tea; did you mean --drink?",
        ),
        ("ann --place p --cakes=--", "argument --cakes: expected a value, not '--'"),
        ("ann --place p --sizes=--", "argument --sizes: expected a value, not '--'"),
        ("ann --p p --cakes", "argument --cakes: expected one argument"),
        ("ann --place p --note 3", "unrecognized arguments: --note 3"),
    ],
)
def test_lines_that_cannot_be_read_are_refused_in_one_line(capsys, arguments, complaint):
    with pytest.raises(SystemExit) as end:
        picnic(*arguments.split())
    assert end.value.code == 2
    assert capsys.readouterr().err == f"picnic: error: {complaint} (see picnic --help)\n"


HELP = """\
usage: picnic WHO --place MEADOW [OPTIONS]

Have a picnic.

positional arguments:
  WHO             who comes

options:
  -h, --help      show this help message and exit
  --cakes N       how many, 1 to 9 [cakes] (default: 2)
  --hours X       how long, 0.5 to 8 (default: until it rains)
  --sizes N ...   of the cakes, 1 to 3 (default: 1 2)
  --vegan         100 % plants
  --place MEADOW  where

drinks:
  --drink NAME    what there is: tea, juice (default: tea)
"""


def test_help_says_meaning_choices_range_unit_and_default(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as end:
        picnic("--help")
    assert end.value.code == 0
    assert capsys.readouterr().out == HELP


@dataclass(frozen=True, kw_only=True)
class Feast(Picnic):
    """A picnic whose guests mostly ask for one thing."""

    music: str = setting("none", "to dance to", is_common=True)
    speed: int = setting(1, "of the dance", group="dances, at night")


def test_help_shows_the_common_and_needed_options_and_says_where_the_others_are(capsys):
    shown = {}
    for flag in ("--help", "--help-all"):
        with pytest.raises(SystemExit) as end:
            parse_options(Feast, [flag], "feast", "Have a feast.")
        assert end.value.code == 0
        shown[flag] = capsys.readouterr().out
    for common in ("WHO", "--place MEADOW", "--music NAME", "--help-all"):
        assert common in shown["--help"]
    for rare in ("--cakes", "--hours", "--sizes", "--vegan", "--drink", "--speed"):
        assert rare not in shown["--help"]
        assert rare in shown["--help-all"]
    assert shown["--help"].endswith("\nfeast --help-all shows 6 more: drinks, dances\n")
    assert "6 more" not in shown["--help-all"]
    typed = ["ann", "--place", "p", "--cakes", "3"]
    assert parse_options(Feast, typed, "feast", "").num_cakes == 3


@pytest.mark.parametrize("command", ["fly", "evaluate", "train"])
def test_the_help_of_the_large_commands_is_a_screen_or_so(capsys, command):
    assert main([command, "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].startswith(f"swarm-mj {command} --help-all shows ")
    flags = [line for line in lines if line.startswith("  --")]
    assert len(flags) <= 16


def test_help_breaks_no_name_and_names_only_groups_of_what_it_leaves_out(capsys):
    assert main(["fly", "--help"]) == 0
    assert {name for name in POLICIES if " " not in name} <= set(
        re.split(r"[,\s]+", capsys.readouterr().out)
    )
    assert main(["study", "--help"]) == 0
    assert capsys.readouterr().out.endswith("\nswarm-mj study --help-all shows 8 more\n")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_fits_into_80_columns_without_noise(capsys, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([command, "--help"]) == 0
    brief = capsys.readouterr().out
    is_folded = "--help-all" in brief
    assert main([command, "--help-all" if is_folded else "--help"]) == 0
    shown = brief + capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= 80
    assert COMMANDS[command] in shown
    for noise in ("None", "MISSING", "()", "[]", "{", "dataclass"):
        assert noise not in shown
