"""MuJoCo's static geoms as rerun draws them, by numbers that are known."""

import mujoco
import numpy as np
import rerun as rr

from swarm_mj.replay.static_geoms import FLOOR_M, static_geoms

SCENE = """
<mujoco><worldbody>
  <geom name="box" type="box" size="1 2 3" pos="4 5 6" rgba="1 0 0 1"/>
  <geom name="floor" type="plane" size="7 8 1"/>
  <geom name="pole" type="capsule" size="0.5 2" pos="0 0 10"/>
  <geom name="ball" type="sphere" size="3"/>
  <body><freejoint/><geom name="robot" size="1"/></body>
</worldbody></mujoco>
"""


def numbers(batch):
    return np.ravel(batch.as_arrow_array().to_pylist()).tolist()


def test_obstacles_are_of_glass_and_the_rest_is_not():
    scene = SCENE.replace('name="box"', 'name="box" group="1"')
    solids = static_geoms(mujoco.MjModel.from_xml_string(scene))
    modes = {name: numbers(solid.fill_mode)[0] for name, solid in solids.items()}
    glass = modes.pop("box")
    assert set(modes.values()) == {rr.components.FillMode.Solid.value}
    assert glass == rr.components.FillMode.TransparentFillMajorWireframe.value


def test_what_stands_still_is_drawn_where_it_stands():
    solids = static_geoms(mujoco.MjModel.from_xml_string(SCENE))
    assert solids.keys() == {"box", "floor", "pole", "ball"}
    assert numbers(solids["box"].half_sizes) == [1, 2, 3]
    assert numbers(solids["box"].centers) == [4, 5, 6]
    assert numbers(solids["box"].colors) == [0xFF0000FF]
    assert numbers(solids["floor"].half_sizes) == [7, 8, FLOOR_M]
    assert numbers(solids["floor"].centers) == [0, 0, -FLOOR_M]
    assert numbers(solids["pole"].translations) == [0, 0, 8]  # its lower end
    assert numbers(solids["ball"].half_sizes) == [3, 3, 3]
