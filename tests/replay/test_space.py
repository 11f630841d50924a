"""The scene in three dimensions, read back from the file, against the flight and MuJoCo's model."""

from dataclasses import replace

import mujoco
import numpy as np
import rerun as rr
from mujoco import mjtGeom
from reading import column, counts, entities, rows, static
from rerun.chunk import RrdReader

from swarm_mj.replay.packets import SEGMENTS
from swarm_mj.replay.space import FLOOR_M, static_geoms
from swarm_mj.replay.write import write_replay


def test_bodies_stand_where_the_robots_are(replay, two_way):
    where = rows(replay, "/scene/robots", "Cylinders3D:centers", 12, 3)
    np.testing.assert_allclose(where[..., :2], two_way.log.position_m, rtol=1e-6, atol=1e-4)
    assert np.all(where[..., 2] > 0.0)
    radii = static(replay, "/scene/robots", "Cylinders3D:radii")
    assert (len(radii), np.argmax(radii)) == (12, two_way.log.ego)
    on_map = column(replay, "/arena/robots", "Points2D:colors").flatten().to_numpy()
    in_space = column(replay, "/scene/robots", "Cylinders3D:colors").flatten().to_numpy()
    np.testing.assert_array_equal(in_space, on_map)


def test_a_window_s_arcs_are_its_packets(replay, two_way):
    links, position_m = two_way.log.packets["delivered"], two_way.log.position_m
    entity, component = "/scene/packets/delivered", "LineStrips3D:strips"
    per_window = counts(replay, entity, component)
    np.testing.assert_array_equal(per_window, two_way.counted("delivered"))
    points = column(replay, entity, component).flatten().flatten().flatten()
    points = points.to_numpy().reshape(-1, SEGMENTS + 1, 3)
    for at, robot in ((0, links.sender), (-1, links.receiver)):
        where = position_m[links.row, robot]
        np.testing.assert_allclose(points[:, at, :2], where, rtol=1e-5, atol=1e-2)
    assert np.all(points[:, SEGMENTS // 2, 2] > points[:, 0, 2])


def test_walls_and_floor_are_the_model_s(replay, two_way):
    half = two_way.mission.half_side_m
    east = static(replay, "/scene/area/wall_east", "Boxes3D:half_sizes")
    np.testing.assert_allclose(east, [2.0, half + 4.0, 5.0], rtol=1e-6)
    floor = static(replay, "/scene/area/floor", "Boxes3D:half_sizes")
    np.testing.assert_allclose(floor[:2], half)


def test_pointing_at_an_obstacle_shows_its_loss(blocked_replay):
    blocks = {path for path in entities(blocked_replay) if path.startswith("/scene/area/geom")}
    assert len(blocks) == 9
    assert {float(static(blocked_replay, path, "loss_db")[0]) for path in blocks} == {25.0}


def test_a_scene_of_one_s_own_is_drawn_whatever_its_geoms(two_way, tmp_path):
    turned = [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]  # lies along x

    def town(spec, _mission):
        add = spec.worldbody.add_geom
        add(name="house", type=mjtGeom.mjGEOM_BOX, pos=[50, 60, 10], size=[5, 6, 10])
        add(name="ball", type=mjtGeom.mjGEOM_SPHERE, pos=[0, 0, 4], size=[4, 0, 0])
        add(name="pipe", type=mjtGeom.mjGEOM_CAPSULE, pos=[9, 9, 2], size=[2, 7, 0], quat=turned)
        add(name="tower", type=mjtGeom.mjGEOM_CYLINDER, pos=[1, 2, 8], size=[3, 8, 0])
        spec.add_mesh(name="tent", uservert=[0, 0, 0, 8, 0, 0, 0, 8, 0, 0, 0, 8])
        add(name="camp", type=mjtGeom.mjGEOM_MESH, meshname="tent", pos=[-40, -40, 0])

    path = tmp_path / "town.rrd"
    write_replay(replace(two_way.log, scene=town), two_way.mission, {"seed": 5}, path)
    kinds = {
        chunk.entity_path.removeprefix("/scene/area/"): name.split(":")[0]
        for chunk in RrdReader(path).stream().filter(content="/scene/area/**")
        for name in chunk.to_record_batch().schema.names
        if name.split(":")[-1] in ("half_sizes", "lengths")
    }
    walls = {f"wall_{side}": "Boxes3D" for side in ("east", "west", "north", "south")}
    solids = {"floor": "Boxes3D", "house": "Boxes3D", "camp": "Boxes3D", "ball": "Ellipsoids3D"}
    assert kinds == walls | solids | {"pipe": "Capsules3D", "tower": "Cylinders3D"}
    start = static(path, "/scene/area/pipe", "Capsules3D:translations")
    np.testing.assert_allclose(start, [2.0, 9.0, 2.0], atol=1e-6)  # 7 m west of its middle
    assert np.all(static(path, "/scene/area/camp", "Boxes3D:half_sizes") > 0.0)


def test_a_team_at_rest_has_no_headings(still_replay):
    assert {"/scene/robots", "/scene/heading"} & entities(still_replay) == {"/scene/robots"}


SCENE = """
<mujoco><worldbody>
  <geom name="box" type="box" size="1 2 3" pos="4 5 6" rgba="1 0 0 1" group="1"/>
  <geom name="floor" type="plane" size="7 8 1"/>
  <geom name="pole" type="capsule" size="0.5 2" pos="0 0 10"/>
  <geom name="ball" type="sphere" size="3"/>
  <body><freejoint/><geom name="robot" size="1"/></body>
</worldbody></mujoco>
"""


def test_geoms_that_never_move_are_drawn_where_they_stand_and_obstacles_of_glass():
    def numbers(name, field):
        return np.ravel(getattr(solids[name], field).as_arrow_array().to_pylist()).tolist()

    solids = static_geoms(mujoco.MjModel.from_xml_string(SCENE))
    assert solids.keys() == {"box", "floor", "pole", "ball"}
    assert numbers("box", "half_sizes") == [1, 2, 3]
    assert numbers("box", "centers") == [4, 5, 6]
    assert numbers("box", "colors") == [0xFF0000FF]
    assert numbers("floor", "half_sizes") == [7, 8, FLOOR_M]
    assert numbers("floor", "centers") == [0, 0, -FLOOR_M]
    assert numbers("pole", "translations") == [0, 0, 8]  # its lower end
    assert numbers("ball", "half_sizes") == [3, 3, 3]
    mode = rr.components.FillMode
    glass, solid = mode.TransparentFillMajorWireframe.value, mode.Solid.value
    assert [numbers(name, "fill_mode")[0] for name in solids] == [glass, solid, solid, solid]
