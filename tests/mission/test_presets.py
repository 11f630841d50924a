"""Presets against the paper's text, its authors' code and the sources of their channels."""

import pytest

from swarm_mj.mission import PRESETS, paper, reference

TASKS = ["stationary", "random-walk", "flocking"]


@pytest.mark.parametrize("task", TASKS)
def test_paper_follows_the_text(task):
    mission = paper(task)
    assert (mission.preset, mission.task) == ("paper", task)
    assert mission.max_acceleration_mps2 == 20.0
    assert mission.wall_hit == "mirror"
    assert mission.half_duplex == "strict"
    assert mission.flocking_set == "heard"
    assert not mission.silence_is_attempt
    assert not mission.moves_each_transmission
    assert not mission.tree_recomputed
    assert not mission.tree_root_transmits


@pytest.mark.parametrize("task", TASKS)
def test_reference_follows_the_code(task):
    mission = reference(task)
    assert (mission.preset, mission.task) == ("reference", task)
    assert mission.max_acceleration_mps2 == 10.0
    assert mission.wall_hit == "clip"
    assert mission.half_duplex == "eavesdroppers"
    assert mission.flocking_set == "moving"
    assert mission.silence_is_attempt
    assert mission.moves_each_transmission
    assert mission.tree_recomputed == (task in ("random-walk", "flocking"))  # "for mobile teams"
    assert mission.tree_root_transmits


@pytest.mark.parametrize("preset", [paper, reference])
def test_only_a_flock_flies_without_walls(preset):
    assert preset("stationary").has_walls
    assert preset("random-walk").has_walls
    assert not preset("flocking").has_walls
    assert preset("flocking", boundary="reflect").has_walls
    assert not preset("random-walk", boundary="none").has_walls


def test_presets_go_by_name():
    assert PRESETS["paper"]("stationary") == paper("stationary")
    assert PRESETS["reference"]("stationary") == reference("stationary")
    assert set(PRESETS) == {"paper", "reference"}


OTHER = {
    "num_robots": 12,
    "range_ratio": 0.5,
    "max_acceleration_mps2": 5.0,
    "wall_hit": "mirror",
    "half_duplex": "strict",
    "flocking_set": "heard",
    "silence_is_attempt": False,
    "moves_each_transmission": False,
    "tree_recomputed": True,
    "tree_root_transmits": False,
}


@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize("name", OTHER)
def test_any_field_can_be_overridden(preset, name):
    assert getattr(preset("stationary", **{name: OTHER[name]}), name) == OTHER[name]
