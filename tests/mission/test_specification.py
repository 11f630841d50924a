"""The mission's numbers against the paper's text, hand arithmetic and the table of differences."""

import math
import runpy
from dataclasses import FrozenInstanceError, fields
from typing import Literal, get_args, get_origin

import numpy as np
import pytest

from swarm_mj.mission import Mission, paper, reference
from swarm_mj.mission import specification as mission_module
from swarm_mj.mission.labels import CHANNEL
from swarm_mj.system.fields import former_names, kind_of, meaning_of

# As users load it: without the type checks that these tests run under, which would answer first.
Unchecked = runpy.run_path(mission_module.__file__)["Mission"]

QUANTITIES = [spec for spec in fields(Mission) if meaning_of(spec).has_range]
CHOICES = [spec for spec in fields(Mission) if meaning_of(spec).choices]
SUSPECTS = [0, 1, -1, -(10**12), 10**15, math.nan, math.inf, -math.inf]


def beyond(spec):
    """Values outside a field's range: the usual suspects, and those just past each end."""
    low, high = meaning_of(spec).low, meaning_of(spec).high
    step = 1 if kind_of(spec) is int else 1e-3 * (high - low)
    suspects = [*SUSPECTS, low - step, high + step]
    return [
        kind_of(spec)(value) if math.isfinite(value) else value
        for value in suspects
        if not low <= value <= high
    ]


REFUSED = [(spec, value) for spec in QUANTITIES for value in beyond(spec)]


NUMBERS = {  # "The team of 40 robots operates in a mission area of 1 km²", ... (IV-B)
    "num_robots": 40, "density_per_km2": 40.0, "range_ratio": 0.25, "velocity_ratio": 0.15,
    "window_s": 0.1, "num_windows": 500, "sinr_threshold_db": 1.0, "noise_dbm": -50.0,
    "frequency_hz": 2.4e9, "failure_fraction": 0.0,
    "side_m": 1000.0, "half_side_m": 500.0, "range_m": 250.0, "max_velocity_mps": 3.0,
}  # fmt: skip


@pytest.mark.parametrize("preset", [paper, reference])
def test_the_papers_numbers(preset):
    mission = preset()
    assert {name: getattr(mission, name) for name in NUMBERS} == pytest.approx(NUMBERS)


def test_the_bare_mission_is_the_papers_text_with_walls():
    assert Mission() == paper("flocking", boundary="reflect")


# Fields that are no options: what the paper fixes, and where its text and its authors' code differ.
NO_OPTIONS = {
    "max_acceleration_mps2",
    "window_s",
    "frequency_hz",
    "wall_hit",
    "half_duplex",
    "flocking_set",
    "silence_is_attempt",
    "moves_each_transmission",
    "tree_recomputed",
    "tree_root_transmits",
}


def test_a_field_is_an_option_unless_it_is_known_to_be_none():
    assert {spec.name for spec in fields(Mission) if not meaning_of(spec).help} == NO_OPTIONS


@pytest.mark.parametrize("spec", fields(Mission), ids=lambda spec: spec.name)
def test_every_field_names_its_source_and_the_choices_of_its_type(spec):
    about = meaning_of(spec)
    assert about.source
    if get_origin(spec.type) is Literal:
        assert about.choices == get_args(spec.type)


PURE_NUMBERS = {"loss_exponent", "rician_k", "erasure"}  # a "[1]" in the help puzzles readers
CHANNEL_FIELDS = [spec for spec in fields(Mission) if meaning_of(spec).group == CHANNEL]


@pytest.mark.parametrize("spec", CHANNEL_FIELDS, ids=lambda spec: spec.name)
def test_every_field_of_the_channel_is_an_option_with_its_choices_or_unit_and_range(spec):
    about = meaning_of(spec)
    assert about.help
    has_unit = bool(about.unit) or spec.name in PURE_NUMBERS
    assert about.choices or (has_unit and about.has_range)


def test_what_counts_with_another_field_counts_with_one_that_is_there_and_is_off():
    """That the other one is there is checked as the class is made; so is its choice."""
    names = {spec.name for spec in fields(Mission)}
    switches = {spec.name: meaning_of(spec).counts_with for spec in fields(Mission)}
    on = {name: switch for name, switch in switches.items() if switch}
    assert {switch.name for switch in on.values()} < names
    assert not any(switch.is_on(paper()) for switch in on.values())
    by_state = {name: switch.name for name, switch in on.items() if switch.state}
    assert (
        by_state.items()
        >= {
            "loss_exponent": "path_loss",
            "reference_m": "path_loss",
            "antenna_height_m": "path_loss",
            "rician_k": "fading",
            "map_offset_m": "prior_knowledge",
        }.items()
    )


@pytest.mark.parametrize(("former", "present"), former_names(Mission).items())
def test_a_former_name_leads_to_the_present_one(former, present):
    with pytest.raises(TypeError, match=f"'{former}'; did you mean {present}?"):
        Unchecked(**{former: 0.5})


# What the paper's missions have none of.
NOTHING_UNLESS_ASKED = {
    "failure_fraction",
    "shadowing_db",
    "erasure",
    "burst_begin",
    "high_power_fraction",
    "clock_offset_s",
    "clock_drift_ppm",
    "map_offset_m",
    "position_noise_m",
    "height_range_m",
    "robot_spread",
    "wind_mps",
    "gust_mps",
    "sensing_miss",
    "sensing_false_alarm",
}
# The noise hides what is far below it.
GOES_WITH = {"sensing_dbm": {"noise_dbm": -200.0}}


@pytest.mark.parametrize("spec", QUANTITIES, ids=lambda spec: spec.name)
def test_every_quantity_names_its_unit_and_source(spec):
    about = meaning_of(spec)
    assert about.label
    assert (about.unit == "") == (spec.name in PURE_NUMBERS)
    assert about.source
    if spec.default is None:  # without a limit
        return
    assert about.low <= spec.default < about.high
    assert (about.low == spec.default) == (spec.name in NOTHING_UNLESS_ASKED)


@pytest.mark.parametrize("spec", QUANTITIES, ids=lambda spec: spec.name)
@pytest.mark.parametrize("end", ["low", "high"])
def test_the_ends_of_a_range_are_allowed(spec, end):
    value = kind_of(spec)(getattr(meaning_of(spec), end))
    given = GOES_WITH.get(spec.name, {}) | {spec.name: value}
    assert getattr(Mission(**given), spec.name) == value


@pytest.mark.parametrize(
    ("given", "floor_dbm"),
    [
        ({}, -57.0),
        ({"sensing_gain_db": 0.0}, -47.0),
        ({"noise_dbm": -94.0, "sensing_gain_db": 12.5}, -103.5),
    ],
)
def test_robots_sense_down_to_3_db_over_the_noise_less_the_gain(given, floor_dbm):
    assert paper(**given).sensing_floor_dbm == floor_dbm
    assert paper(sensing_dbm=floor_dbm, **given).sensing_dbm == floor_dbm
    with pytest.raises(ValueError, match=r"^sensing threshold must be") as refusal:
        paper(sensing_dbm=floor_dbm - 0.5, **given)
    said = str(refusal.value)
    assert f"at least {floor_dbm:g} dBm" in said
    assert f"not {floor_dbm - 0.5:g}; choose that or more, or a larger sensing gain" in said


def test_minislots_leave_some_of_a_slot():
    """64 of 20 µs take 1.28 ms of 50; 100 of 500 µs would take all of it."""
    assert paper().contention_s == pytest.approx(1.28e-3)
    with pytest.raises(ValueError, match="100 minislots of 500 µs take 50 ms, but a slot has 50"):
        paper(minislots=100, minislot_us=500.0)
    assert paper(minislots=99, minislot_us=500.0).contention_s == pytest.approx(49.5e-3)


@pytest.mark.parametrize(
    ("spec", "value"), REFUSED, ids=[f"{spec.name}={value:g}" for spec, value in REFUSED]
)
def test_values_outside_their_range_are_refused(spec, value):
    with pytest.raises(ValueError, match=meaning_of(spec).label) as refusal:
        Unchecked(**{spec.name: value})
    message = str(refusal.value)
    allowed, given = message.rsplit("not", 1)
    about = meaning_of(spec)
    assert f"from {about.low:g} to {about.high:g}" in allowed
    assert about.unit in allowed
    assert float(given) == pytest.approx(value, rel=1e-5, nan_ok=True)


@pytest.mark.parametrize(
    ("field", "value", "kind"),
    [
        ("num_robots", 2.5, "a whole number from 2 to 10000"),
        ("num_robots", "40", "a whole number from 2 to 10000"),
        ("range_ratio", "wide", "a number from 0.01 to 10"),
        ("silence_is_attempt", "no", "True or False"),
    ],
)
def test_values_of_another_kind_are_refused(field, value, kind):
    with pytest.raises(ValueError, match=f"must be {kind}.* not {value!r}"):
        Unchecked(**{field: value})


def test_numpy_s_numbers_are_numbers():
    mission = Unchecked(num_robots=np.int64(20), range_ratio=np.float32(0.5))
    assert mission.range_m == 500.0


@pytest.mark.parametrize("spec", CHOICES, ids=lambda spec: spec.name)
def test_unknown_choices_are_refused(spec):
    with pytest.raises(ValueError, match=meaning_of(spec).label) as refusal:
        Unchecked(**{spec.name: "telepathy"})
    assert "'telepathy'" in str(refusal.value)
    for choice in meaning_of(spec).choices:
        assert choice in str(refusal.value)
        assert getattr(Unchecked(**{spec.name: choice}), spec.name) == choice


def test_a_mission_cannot_change():
    with pytest.raises(FrozenInstanceError):
        paper().num_robots = 3


def test_an_arena_is_a_name():
    with pytest.raises(ValueError, match="arena must be a name, not 3"):
        Unchecked(arena=3)
