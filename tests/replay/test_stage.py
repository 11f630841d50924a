"""What stands still, read back from the file, against the mission and MuJoCo's model."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import rerun as rr
from mujoco import mjtGeom
from reading import entities, static

from swarm_mj.physics.arenas import BLOCK_M
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.stage import FLOOR_M, filling, square_m, static_geoms
from swarm_mj.replay.write import write_replay


def test_walls_and_floor_are_the_model_s_and_north_is_up(replay, two_way):
    half = two_way.log.facts.mission.half_side_m
    east = static(replay, "/scene/area/wall_east", "Boxes3D:half_sizes")
    np.testing.assert_allclose(east, [2.0, half + 4.0, 5.0], rtol=1e-6)
    floor = static(replay, "/scene/area/floor", "Boxes3D:half_sizes")
    np.testing.assert_allclose(floor[:2], half)
    north_up = [1, 0, 0, 0, -1, 0, 0, 0, 1]
    np.testing.assert_array_equal(static(replay, "/arena", "Transform3D:mat3x3"), north_up)


@pytest.mark.parametrize(
    ("reach_m", "way_m", "square"), [(500.0, 0.0, 100.0), (500.0, 4e3, 100.0), (500.0, 9e3, 1e3)]
)
def test_squares_are_few_enough_to_be_seen(reach_m, way_m, square):
    centre_m = np.array([[0.0, 0.0], [way_m, 0.0]])
    assert square_m(Ground(centre_m=centre_m, reach_m=reach_m)) == square


def test_the_city_s_blocks_are_on_the_map_and_say_their_loss(blocked, blocked_replay):
    """14 robots have a side of 592 m: three blocks of 110 m by three."""
    strips = static(blocked_replay, "/arena/world/obstacle", "LineStrips2D:strips")
    outlines = np.array(strips.tolist()).reshape(9, 5, 2)
    np.testing.assert_allclose(np.ptp(outlines, axis=1), BLOCK_M, rtol=1e-5)
    assert np.abs(outlines).max() < blocked.log.facts.mission.half_side_m
    blocks = {path for path in entities(blocked_replay) if path.startswith("/scene/area/geom")}
    assert len(blocks) == 9
    assert {float(static(blocked_replay, path, "loss_db")[0]) for path in blocks} == {25.0}


def test_a_scene_of_one_s_own_is_drawn(two_way, tmp_path):
    def town(spec, _mission):
        spec.worldbody.add_geom(name="house", type=mjtGeom.mjGEOM_BOX, size=[5, 6, 10])

    write_replay(replace(two_way.log, scene=town), {"seed": 5}, tmp_path / "a.rrd")
    size = static(tmp_path / "a.rrd", "/scene/area/house", "Boxes3D:half_sizes")
    assert size.tolist() == [5, 6, 10]


SCENE = """
<mujoco>
  <asset><mesh name="tent" vertex="0 0 0 8 0 0 0 8 0 0 0 8"/></asset>
  <worldbody>
    <geom name="box" type="box" size="1 2 3" pos="4 5 6" rgba="1 0 0 1" group="1"/>
    <geom name="floor" type="plane" size="7 8 1"/>
    <geom name="pole" type="capsule" size="0.5 2" pos="0 0 10" euler="0 90 0"/>
    <geom name="tower" type="cylinder" size="3 8"/>
    <geom name="ball" type="sphere" size="3"/>
    <geom name="camp" type="mesh" mesh="tent"/>
    <body><freejoint/><geom name="robot" size="1"/></body>
  </worldbody>
</mujoco>
"""


def test_geoms_that_never_move_are_drawn_where_they_stand_and_obstacles_of_glass():
    def numbers(name, field):
        return np.ravel(getattr(solids[name][0], field).as_arrow_array().to_pylist()).tolist()

    solids = static_geoms(mujoco.MjModel.from_xml_string(SCENE))
    assert {name: type(drawn).__name__ for name, (drawn, *_) in solids.items()} == {
        **{"box": "Boxes3D", "floor": "Boxes3D", "pole": "Capsules3D"},
        **{"tower": "Cylinders3D", "ball": "Ellipsoids3D", "camp": "Boxes3D"},
    }
    assert numbers("box", "half_sizes") == [1, 2, 3]
    assert numbers("box", "centers") == [4, 5, 6]
    assert numbers("box", "colors") == [0xFF0000FF]
    assert numbers("floor", "half_sizes") == [7, 8, FLOOR_M]
    assert numbers("floor", "centers") == [0, 0, -FLOOR_M]
    assert numbers("pole", "translations") == pytest.approx([-2, 0, 10])  # its west end
    assert numbers("ball", "half_sizes") == [3, 3, 3]
    assert min(numbers("camp", "half_sizes")) > 0
    mode = rr.components.FillMode
    glass, solid = mode.TransparentFillMajorWireframe.value, mode.Solid.value
    assert [numbers(name, "fill_mode")[0] for name in solids] == [glass, *[solid] * 5]


def test_lines_fill_an_outline():
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    corners = np.array([(-3, -2), (3, -2), (3, 2), (-3, 2), (-3, -2)]) @ turn
    lines = filling(corners, 0.05)
    high_m = np.ptp(corners[:, 1]) / len(lines)
    assert high_m <= 0.05
    assert sum(b[0] - a[0] for a, b in lines) * high_m == pytest.approx(24.0, rel=0.01)
