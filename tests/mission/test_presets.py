"""Presets against the paper's text, its authors' code and the sources of their channels."""

import math
from typing import get_args

import pytest

from swarm_mj.mission import PRESETS, WORLDS, Mission, make_mission, paper, reference
from swarm_mj.mission.team import Preset
from swarm_mj.physics.materials import BUILDING
from swarm_mj.radio.free_space import path_loss_db

TASKS = ["stationary", "random-walk", "flocking"]


TEXT = {
    "preset": "paper", "max_acceleration_mps2": 20.0, "wall_hit": "mirror",
    "half_duplex": "strict", "flocking_set": "heard", "silence_is_attempt": False,
    "moves_each_transmission": False, "tree_recomputed": False, "tree_root_transmits": False,
}  # fmt: skip
CODE = {
    "preset": "reference", "max_acceleration_mps2": 10.0, "wall_hit": "clip",
    "half_duplex": "eavesdroppers", "flocking_set": "moving", "silence_is_attempt": True,
    "moves_each_transmission": True, "tree_root_transmits": True,
}  # fmt: skip


def test_every_name_of_a_preset_makes_missions_of_that_name():
    assert tuple(PRESETS) == get_args(Preset)
    assert {name: make().preset for name, make in PRESETS.items()} == {
        name: name for name in PRESETS
    }


def test_a_mission_is_made_of_a_task_of_a_preset_or_of_another_mission():
    assert make_mission() == paper()
    assert make_mission("stationary") == make_mission(task="stationary") == paper("stationary")
    assert make_mission(preset="urban") == PRESETS["urban"]("random-walk")
    assert make_mission("flocking", preset="urban", num_robots=9).num_robots == 9
    walk = reference("random-walk", num_robots=7)
    assert make_mission(walk) is make_mission(walk, preset="reference") is walk
    assert make_mission(walk, num_robots=8) == reference("random-walk", num_robots=8)


@pytest.mark.parametrize(
    ("given", "named", "complaint"),
    [
        ((), {"preset": "urbann"}, "preset must be one of .* not 'urbann'; did you mean urban"),
        ((Mission(),), {"preset": "urban"}, "is given whole, from the preset paper; leave it out"),
        (("flocking",), {"task": "flocking"}, "multiple values for keyword argument 'task'"),
        (("flok",), {}, "task must be one of .* not 'flok'; did you mean flocking"),
        ((), {"num_robot": 3}, "did you mean num_robots"),
        ((Mission(),), {"num_robot": 3}, "did you mean num_robots"),
    ],
)
def test_no_mission_is_made_of_what_contradicts_or_is_unknown(given, named, complaint):
    with pytest.raises((ValueError, TypeError), match=complaint):
        make_mission(*given, **named)


@pytest.mark.parametrize("task", TASKS)
def test_presets_follow_the_text_and_the_code(task):
    code = CODE | {"tree_recomputed": task in ("random-walk", "flocking")}  # "for mobile teams"
    for preset, numbers in ((paper, TEXT), (reference, code)):
        mission = preset(task)
        assert {name: getattr(mission, name) for name in numbers} == numbers
        assert mission.task == task


@pytest.mark.parametrize("preset", [paper, reference])
def test_only_a_flock_flies_without_walls(preset):
    assert preset("stationary").has_walls
    assert preset("random-walk").has_walls
    assert not preset("flocking").has_walls
    assert preset("flocking", boundary="reflect").has_walls
    assert not preset("random-walk", boundary="none").has_walls


@pytest.mark.parametrize("preset", [paper, reference])
def test_robots_that_collide_fly_in_contact_physics(preset):
    assert preset(collide=True).physics == "contact"
    assert preset(collide=False).physics == "exact"
    with pytest.raises(ValueError, match=r"choose physics contact, or .* pass through each other"):
        preset(collide=True, physics="exact")


@pytest.mark.parametrize("name", WORLDS)
def test_a_world_is_the_papers_text_but_for_its_arena_and_channel(name):
    mission, paper_s = PRESETS[name](), paper("random-walk")
    differs = {key for key, value in vars(mission).items() if value != getattr(paper_s, key)}
    about_arena = {"arena", "physics"} if mission.arena != "open" else set()
    assert differs - {"preset"} - about_arena <= {
        *("path_loss", "loss_exponent", "reference_m", "antenna_height_m"),
        *("shadowing_db", "shadowing_distance_m", "fading", "rician_k"),
    }
    assert mission.preset == name


@pytest.mark.parametrize("name", WORLDS)
def test_whatever_is_given_beside_a_world_overrides_it(name):
    given = {"fading": "none", "num_robots": 7, "path_loss": "free-space", "arena": "open"}
    mission = PRESETS[name]("flocking", **given)
    assert {key: getattr(mission, key) for key in given} == given
    assert (mission.task, mission.physics, mission.boundary) == ("flocking", "exact", "none")


def loss_db(mission, distance_m):
    """Log-distance path loss (Rappaport 2002, Eq. 4.69)."""
    at_reference_db = path_loss_db(mission.reference_m, mission.frequency_hz)
    decades = math.log10(distance_m / mission.reference_m)
    return at_reference_db + 10.0 * mission.loss_exponent * decades


def test_channels_of_worlds_are_their_sources():
    """TR 38.901: UMi at 100 m and 2.4 GHz loses 32.4 + 42 + 7.6 dB; K are 9, 7 and 7 dB."""
    urban = PRESETS["urban"]()
    assert loss_db(urban, 100.0) == pytest.approx(82.0, abs=0.1)
    in_db = {name: 10.0 * math.log10(PRESETS[name]().rician_k) for name in WORLDS}
    assert in_db == pytest.approx({"indoor": 7.0, "urban": 9.0, "open-field": 7.0}, abs=0.05)


def test_a_block_takes_about_what_umi_loses_without_line_of_sight():
    """At 200 m, 2.4 GHz: 35.3 log10(200) + 22.4 + 21.3 log10(2.4) dB without line of sight."""
    urban = PRESETS["urban"]()
    without_db = 35.3 * math.log10(200.0) + 22.4 + 21.3 * math.log10(2.4)
    through_db = loss_db(urban, 200.0) + BUILDING.loss_db
    assert through_db == pytest.approx(without_db, abs=2.0)
