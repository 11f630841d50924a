"""Values that are checked where they are declared."""

import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from swarm_mj.system.fields import (
    FORMER_NAMES,
    GONE_IN,
    check,
    did_you_mean,
    kind_of,
    same_as,
    setting,
)

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, kw_only=True)
class Kettle:
    """Some settings."""

    litres: float = setting(1.5, "how much", label="volume", unit="l", low=0.1, high=3.0)
    cups: tuple[int, ...] = setting((1,), low=1, high=6)
    minutes: int | None = setting(None, low=0, high=60)
    colour: Literal["red", "blue"] = setting("red", choices=("red", "blue"))
    is_on: bool = False

    def __post_init__(self):
        check(self)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"litres": 3.1}, "volume must be a number from 0.1 to 3 [l], not 3.1"),
        ({"litres": float("nan")}, "volume must be a number from 0.1 to 3 [l], not nan"),
        ({"litres": "1"}, "volume must be a number from 0.1 to 3 [l], not '1'"),
        ({"litres": None}, "volume must be a number from 0.1 to 3 [l], not None"),
        ({"cups": (1, 7)}, "cups must be a whole number from 1 to 6, not 7"),
        ({"cups": (1.0,)}, "cups must be a whole number from 1 to 6, not 1.0"),
        ({"minutes": -1}, "minutes must be a whole number from 0 to 60, not -1"),
        ({"colour": "pink"}, "colour must be one of red, blue, not 'pink'"),
        ({"colour": "bleu"}, "colour must be one of red, blue, not 'bleu'; did you mean blue?"),
        ({"is_on": 1}, "is_on must be True or False, not 1"),
    ],
)
def test_others_are_named_with_what_is_allowed(values, complaint):
    with pytest.raises(ValueError, match="must be") as refusal:
        Kettle(**values)
    assert str(refusal.value) == complaint


def test_sound_values_pass_and_the_kind_is_that_of_a_single_value():
    Kettle(litres=np.float64(0.1), cups=(1, 6), minutes=60, colour="blue", is_on=True)
    Kettle(litres=3, cups=(), minutes=None)
    numpys = Kettle(litres=np.float32(0.5), cups=(np.int64(1), 6), minutes=np.int16(3))
    plain = Kettle(litres=0.5, cups=(1, 6), minutes=3)
    assert json.dumps(asdict(numpys)) == json.dumps(asdict(plain))
    kinds = {name: kind_of(spec) for name, spec in Kettle.__dataclass_fields__.items()}
    assert kinds == {"litres": float, "cups": int, "minutes": int, "colour": str, "is_on": bool}


def test_a_field_like_another_has_its_default_and_range():
    @dataclass
    class Pot:
        litres: float = same_as(Kettle, "litres")

    assert Pot().litres == 1.5
    with pytest.raises(ValueError, match="volume must be a number"):
        check(Pot(litres=9.0))


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("windows", "num_windows"), ("robots", "num_robots"), ("num_robot", "num_robots")],
)
def test_the_name_that_was_meant_holds_the_word_or_is_like_it(typed, meant):
    known = ["window_s", "num_windows", "num_robots", "noise_dbm"]
    assert did_you_mean(typed, known) == f"; did you mean {meant}?"


def test_former_names_are_listed_with_the_date_until_when_they_work():
    options = (ROOT / "docs/options.md").read_text().split("## Former names")[1].split("\n## ")[0]
    rows = re.findall(r"\| `(\w+)` \| `(\w+)` \|$", options, re.MULTILINE)
    assert dict(rows) == FORMER_NAMES
    for page in (options, (ROOT / "CHANGELOG.md").read_text()):
        assert GONE_IN in " ".join(page.split())
        assert all(f"`{name}`" in page or f"`--{name}" in page for name in FORMER_NAMES)
