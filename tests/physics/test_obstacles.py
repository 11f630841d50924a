"""Which geoms of a small scene are obstacles, what they cost, and which nobody can meet."""

from dataclasses import replace

import mujoco
import pytest

from swarm_mj.mission import paper
from swarm_mj.physics.materials import DEFAULT_LOSS_DB, MATERIALS
from swarm_mj.physics.obstacles import (
    OBSTACLE_GROUP,
    idle_obstacles,
    loss_db_of,
    obstacle_geoms,
    obstacles_of,
)
from swarm_mj.physics.state import ROBOT_HEIGHT_M

Z = ROBOT_HEIGHT_M


def scene(*geoms, size=1):
    """A model of these geoms, in the group of obstacles unless they name another one."""
    group = f'group="{OBSTACLE_GROUP}"'
    drawn = [f"<geom {geom} {'' if 'group' in geom else group}/>" for geom in geoms]
    text = f"""<mujoco><size nuser_geom="{size}"/>
      <asset><material name="tree"/></asset>
      <worldbody>{"".join(drawn)}</worldbody></mujoco>"""
    return mujoco.MjModel.from_xml_string(text)


BALL = f'type="sphere" size="2" pos="5 0 {Z}"'


def test_an_obstacle_is_static_solid_and_in_its_group():
    """The first is in another group, the second is a plane."""
    model = scene('type="sphere" size="1" group="2"', 'type="plane" size="1 1 1"', BALL)
    assert obstacle_geoms(model) == [2]
    found = obstacles_of(model)
    assert found.centre_m.tolist() == [[5.0, 0.0, Z]]
    assert found.size_m[0, 0] == 2.0


@pytest.mark.parametrize(
    ("how", "loss_db"),
    [
        ("", DEFAULT_LOSS_DB),
        ('material="tree"', MATERIALS["tree"].loss_db),
        ('user="13"', 13.0),
        ('material="tree" user="13"', 13.0),  # its own number counts
        ('material="tree" user="0"', MATERIALS["tree"].loss_db),  # 0 is none
    ],
)
def test_the_loss_is_the_geoms_own_or_its_materials_or_the_default(how, loss_db):
    model = scene(f"{BALL} {how}")
    assert loss_db_of(model, 0) == loss_db
    assert obstacles_of(model).power_left[0] == pytest.approx(10.0 ** (-loss_db / 10.0))


@pytest.mark.parametrize("loss", ["-1", "nan", "inf"])
def test_a_loss_that_is_none_is_refused_by_the_geoms_name(loss):
    model = scene(f'name="rock" {BALL} user="0"')
    model.geom_user[0, 0] = float(loss)
    with pytest.raises(ValueError, match=r"loss of geom rock must be 0 dB or more"):
        obstacles_of(model)


def test_what_stands_outside_the_area_or_off_the_robots_height_is_idle():
    """A side of 1 km ends at 500 m: a ball of 2 m at 503 m is outside, at 501 m it is not."""
    mission = paper("stationary", num_robots=40, boundary="reflect")
    model = scene(
        f'name="in" type="sphere" size="2" pos="501 0 {Z}"',
        f'name="out" type="sphere" size="2" pos="503 0 {Z}"',
        f'name="high" type="sphere" size="2" pos="0 0 {Z + 9}"',
        f'name="low" type="sphere" size="2" pos="0 0 {Z - 9}"',
    )
    idle = idle_obstacles(model, mission)
    assert list(idle) == ["geom out", "geom high", "geom low"]
    assert idle["geom out"] == "outside the area of 1000 m by 1000 m"
    assert idle["geom high"].startswith("above the robots")
    assert idle["geom low"].startswith("below the robots")
    assert "geom out" not in idle_obstacles(model, replace(mission, boundary="none"))
