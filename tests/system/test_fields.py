"""Values that are checked where they are declared."""

import json
from dataclasses import asdict, dataclass, fields
from typing import Literal, get_type_hints

import numpy as np
import pytest

from swarm_mj.system.arguments import check_names
from swarm_mj.system.fields import (
    Meaning,
    MeaningFields,
    above_zero,
    check,
    former_names,
    kind_of,
    meaning_of,
    other_than,
    same_as,
    set_to,
    setting,
)


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


@dataclass(frozen=True, kw_only=True)
class Oven:
    """Settings of which some count with others, and some were called otherwise."""

    heat: str = setting("none", choices=("none", "top", "fan"), former=("warmth", "temperature"))
    fan_rpm: float = setting(900.0, low=1.0, high=3000.0, counts_with=set_to(heat, "fan"))
    steam: float = setting(0.0, low=0.0, high=1.0)
    steam_s: float = setting(5.0, low=1.0, high=60.0, counts_with=above_zero(steam))
    dish: str = setting("tray", "")
    lid_mm: float = setting(2.0, low=1.0, high=9.0, counts_with=other_than(dish, "tray"))
    oil_ml: float = setting(
        2.0, low=1.0, high=9.0, counts_with=other_than(dish, "tray", "pot", parts=str.split)
    )
    light: bool = False


def test_a_field_says_with_which_other_one_it_counts():
    switches = {spec.name: meaning_of(spec).counts_with for spec in fields(Oven)}
    assert {name: each.name for name, each in switches.items() if each} == {
        "fan_rpm": "heat",
        "steam_s": "steam",
        "lid_mm": "dish",
        "oil_ml": "dish",
    }
    assert [each.needed for each in switches.values() if each] == [
        "fan",
        "above 0",
        "other than tray",
        "other than tray or pot",
    ]
    for oven, counting in (
        (Oven(heat="top"), set()),
        (Oven(heat="fan"), {"fan_rpm"}),
        (Oven(heat="top,fan", steam=0.5), {"fan_rpm", "steam_s"}),  # of joined choices, one
        (Oven(dish="pot"), {"lid_mm"}),
        (Oven(dish="pot tray"), {"lid_mm"}),
        (Oven(dish="pot pan"), {"lid_mm", "oil_ml"}),  # of several parts, one
    ):
        assert {name for name, each in switches.items() if each and each.is_on(oven)} == counting


def test_a_slip_in_a_declaration_is_an_error_at_once():
    with pytest.raises(TypeError, match="a range needs both ends, not low=1 and high=None"):
        setting(3, low=1)
    with pytest.raises(TypeError, match="needs one of none, top, fan, not 'fann'"):
        set_to(Oven.__dataclass_fields__["heat"], "fann")
    with pytest.raises(TypeError, match="needs a number that is a `setting`, not 3"):
        above_zero(3)
    with pytest.raises(TypeError, match="needs a number"):  # of a text, nothing is above 0
        above_zero(Oven.__dataclass_fields__["heat"])
    with pytest.raises(TypeError, match="needs a text that is a `setting`, not "):
        other_than(Oven.__dataclass_fields__["steam"], "tray")
    with pytest.raises(TypeError, match="unexpected keyword argument 'lable'"):
        setting(3, lable="a")


def test_former_names_lead_to_the_present_ones():
    former = former_names(Oven)
    assert former == {"warmth": "heat", "temperature": "heat"}
    assert former_names(Kettle, Oven) == former
    with pytest.raises(TypeError, match="argument 'warmth'; did you mean heat"):
        check_names("Oven", ["warmth"], ["light", "heat"], former)


def test_type_checkers_are_told_of_every_field_of_a_meaning():
    declared = {spec.name: spec.type for spec in fields(Meaning)}
    assert get_type_hints(MeaningFields) == {n: k for n, k in declared.items() if n != "help"}
    assert not MeaningFields.__required_keys__
