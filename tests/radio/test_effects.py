"""Every number of the channel is read by one effect or by the plain radio, and each effect acts."""

import math
from collections import Counter
from dataclasses import asdict, fields
from itertools import product
from typing import get_args

import numpy as np
import pytest
from channel_fields import CHANNEL_FIELDS, counting, other_values
from declared import where_class, where_field
from walls import walls

from swarm_mj.mission import Mission, paper
from swarm_mj.mission.surroundings import FadingLaw, PathLossLaw
from swarm_mj.protocol.packets import slot_bytes
from swarm_mj.radio.carrier_sensing import CarrierSensing, usual_busy_dbm
from swarm_mj.radio.effect import Effect, MissionEffect
from swarm_mj.radio.effects import (
    EFFECTS,
    BodyAntennas,
    Obstruction,
    beyond_free_space,
    effects_of,
    model_of,
)
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import mission_radio, radio_of
from swarm_mj.radio.words import where_flown
from swarm_mj.simulation.localisation import Localisation
from swarm_mj.system.fields import as_typed

WALL = walls(0.1, 0)
EVERYTHING = {
    "shadowing_db": 6.0,
    "erasure": 0.1,
    "burst_begin": 0.1,
    "high_power_fraction": 0.5,
    "clock_offset_s": 0.01,
    "clock_drift_ppm": 10.0,
    "prior_knowledge": "map,statistics",
    "position_noise_m": 1.0,
    "sensing_dbm": -40.0,
    "bit_rate": 1e6,
}
ALL_ON = [
    paper(path_loss=path_loss, fading=fading, **EVERYTHING)
    for path_loss, fading in product(get_args(PathLossLaw), get_args(FadingLaw))
]


def read_by(function):
    """The fields of a mission that a function reads, whatever laws the mission names."""
    every, read = set(), set()

    class Watched(Mission):
        def __getattribute__(self, name):
            read.add(name)
            return super().__getattribute__(name)

    for mission in ALL_ON:
        watched = Watched(**asdict(mission))
        read.clear()  # of what it checks itself
        function(watched)
        every |= read
    return every


RADIO = {effect.__name__: read_by(effect.of) for effect in EFFECTS}
RADIO["the plain radio"] = read_by(radio_of)
BELIEF = read_by(lambda mission: mission_radio(mission, WALL))
NOISE = read_by(lambda mission: Localisation(mission, [np.random.default_rng(0)]))


def sensing_of(mission):
    """All that carrier sensing takes of a mission."""
    truth = mission_radio(mission).truth
    sensing = Mission.contention_s.fget  # of which packets have the rest
    return CarrierSensing(mission, truth), usual_busy_dbm(mission), sensing(mission)


READERS = RADIO | {
    "what robots know": BELIEF.difference(*RADIO.values(), NOISE),
    "packets": read_by(slot_bytes),
    "carrier sensing": read_by(sensing_of).difference(*RADIO.values(), BELIEF, NOISE),
}


def test_every_number_of_the_channel_is_read_once():
    """A new field that no radio reads would change nothing, in silence."""
    count = Counter(name for readers in READERS.values() for name in readers)
    for name in CHANNEL_FIELDS:
        place = f"{where_field(Mission, name)}: {name}"
        assert count[name] != 0, f"{place} is read by no effect, nor by the plain radio"
        assert count[name] == 1, f"{place} is read by several"
    assert {"position_noise_m", "position_noise_s"} <= NOISE


def test_no_effect_is_left_out():
    for effect in MissionEffect.__subclasses__():
        assert effect in EFFECTS, f"{where_class(effect)}: {effect.__name__} is not in EFFECTS"


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_reads_what_it_says(effect):
    assert {*effect.reads} == READERS[effect.__name__] & {*CHANNEL_FIELDS}
    assert {*effect.reads} <= {spec.name for spec in fields(Mission)}


def missions_with(effect):
    """Missions that have this effect alone, one for each state of each field that it reads."""
    for name in effect.reads:
        for value in other_values(name):
            mission = paper(num_robots=4, **{name: value})
            if effect.of(mission) is not None:
                yield mission


def numbers(model):
    """All numbers of a channel, those of its parts too."""
    for part in model:
        if isinstance(part, tuple):
            yield from numbers(part)
        else:
            yield part


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_makes_another_channel_and_is_named(effect):
    place = f"{where_class(effect)}: {effect.__name__}"
    missions = list(missions_with(effect))
    assert missions, f"{place} is had by no mission, whatever it reads"
    for mission in missions:
        (found,) = effects_of(mission)
        assert type(found) is effect
        radio = mission_radio(mission)
        assert not isinstance(radio.channel, FreeSpaceRadio)
        assert radio.truth.channel is not None
        assert found.title in ", ".join(where_flown(mission))
        for said in found.title.split(", "):
            name, _, value = said.partition(" ")
            assert value == as_typed(getattr(mission, name))
        plain = model_of(radio_of(mission), 4, effects=[])
        pairs = zip(numbers(plain), numbers(found.change(plain)), strict=True)
        differs = [not np.array_equal(one, other) for one, other in pairs]
        assert any(differs), f"{place} changes no number of the channel, in {found.title}"


@pytest.mark.parametrize("effect", EFFECTS)
def test_statistics_grant_every_effect_to_robots(effect):
    for mission in missions_with(effect):
        belief = mission_radio(paper(**asdict(mission) | {"prior_knowledge": "statistics"})).belief
        (found,) = effects_of(mission)
        model = found.change(model_of(radio_of(mission), 4, effects=[]))
        assert belief.law is not None
        np.testing.assert_array_equal(belief.law.at_1_m, model.law.at_1_m)
        assert belief.law[1:] == model.law[1:]
        assert (belief.reception, belief.shadowing_db) == (model.reception, model.shadowing_db)


def test_obstacles_are_an_effect_of_the_scene():
    model = Obstruction(obstacles=WALL).change(model_of(radio_of(paper()), 40, effects=[]))
    assert model.law.obstacles is WALL
    assert not isinstance(mission_radio(paper(), WALL).channel, FreeSpaceRadio)
    assert {*Effect.__subclasses__()} == {MissionEffect, Obstruction, BodyAntennas}


def test_bodies_have_antennas_of_their_own_heights_for_two_ray():
    """4 pi h h / lambda, for antennas 1 m up; a title names no height of the mission's."""
    mission = paper(num_robots=4, robot="quadrotor", path_loss="two-ray", antenna_height_m=3.0)
    law = model_of(radio_of(mission), 4, effects_of(mission)).law
    wavelength_m = 299_792_458.0 / mission.frequency_hz
    assert law.breakpoint_m == pytest.approx(4.0 * math.pi / wavelength_m)
    assert law.is_by_height
    assert beyond_free_space(mission) == "path_loss two-ray"


def test_numbers_of_effects_are_the_missions():
    """In units of the channel: 20 ms are 0.4 of a slot of 50 ms, 3 dB a factor of 2."""
    mission = paper(
        num_robots=4,
        clock_offset_s=0.02,
        clock_drift_ppm=50.0,
        high_power_fraction=0.25,
        high_power_db=3.0,
        path_loss="log-distance",
        loss_exponent=3.5,
        reference_m=30.0,
        shadowing_db=6.0,
        shadowing_distance_m=15.0,
    )
    radio = radio_of(mission)
    model = model_of(radio, 4, effects_of(mission))
    assert model.clock_offset == pytest.approx(0.4)
    assert model.clock_drift == pytest.approx(5e-5)
    strengths = model.law.at_1_m / radio.received_at_1_m_mw
    np.testing.assert_allclose(strengths, [10**0.3, 1.0, 1.0, 1.0])
    assert (model.law.breakpoint_m, model.law.exponent) == (30.0, 3.5)
    assert (model.shadowing_db, model.shadowing_distance_m) == (6.0, 15.0)
    assert math.isinf(model_of(radio, 4, effects=[]).law.breakpoint_m)


def test_each_number_that_counts_is_named_in_the_title():
    for name in (*CHANNEL_FIELDS, "position_noise_m", "position_noise_s"):
        usual = paper(**counting(name))
        for value in other_values(name):
            given = counting(name) | {name: value}
            assert where_flown(paper(**given)) != where_flown(usual), name


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({}, ""),
        ({"rician_k": 9.0, "burst_end": 0.2, "loss_exponent": 4.0}, ""),  # of parts that are off
        ({"fading": "rayleigh"}, "fading rayleigh"),
        ({"fading": "rician", "rician_k": 9.0}, "fading rician, rician_k 9"),
        ({"path_loss": "two-ray"}, "path_loss two-ray, antenna_height_m 1"),
        (
            {"shadowing_db": 6.0, "erasure": 0.1},
            "shadowing_db 6, shadowing_distance_m 20, erasure 0.1",
        ),
        ({"high_power_fraction": 0.25, "num_robots": 8}, "num_high_power 2, high_power_db 6"),
        ({"high_power_fraction": 0.25, "high_power_db": 0.0}, ""),
        ({"burst_begin": 0.02}, "burst_begin 0.02, burst_end 0.05"),
    ],
)
def test_what_the_channel_has_beyond_free_space_is_told_in_words(fields, said):
    assert beyond_free_space(paper(**fields)) == said
