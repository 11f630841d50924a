"""Obstacles of compiled scenes: which geoms count, where they are, what they cost."""

import mujoco
import numpy as np
import pytest

from swarm_mj.physics.solid_geoms import DEFAULT_LOSS_DB, OBSTACLE_GROUP, obstacles_of
from swarm_mj.physics.state import BOX, SPHERE


def compiled(body, *, head=""):
    return mujoco.MjModel.from_xml_string(f"<mujoco>{head}<worldbody>{body}</worldbody></mujoco>")


def losses_db(body, *, head=""):
    return (-10 * np.log10(obstacles_of(compiled(body, head=head)).power_left)).round(6).tolist()


def test_only_geoms_of_the_group_that_stand_still_count():
    found = obstacles_of(
        compiled(
            f"""
            <geom type="box" size="1 2 3" pos="4 5 6" group="{OBSTACLE_GROUP}"/>
            <geom type="box" size="1 2 3"/>
            <geom type="plane" size="9 9 1" group="{OBSTACLE_GROUP}"/>
            <body><freejoint/><geom type="sphere" size="1" group="{OBSTACLE_GROUP}"/></body>
            <body pos="7 0 0"><geom type="sphere" size="8" group="{OBSTACLE_GROUP}"/></body>
            """
        )
    )
    assert found.kind.tolist() == [BOX, SPHERE]
    assert found.centre_m.tolist() == [[4, 5, 6], [7, 0, 0]]
    assert found.size_m[0].tolist() == [1, 2, 3]
    assert found.reach_m[1] == 8


def test_losses_come_from_the_geom_or_its_material_or_are_usual():
    geom = f'<geom type="box" size="1 1 1" group="{OBSTACLE_GROUP}"'
    material = '<asset><material name="heavy wall"/><material name="paper"/></asset>'
    body = f'{geom} material="heavy wall"/>{geom} material="paper"/>{geom}/>'
    assert losses_db(body, head=material) == [6.9, DEFAULT_LOSS_DB, DEFAULT_LOSS_DB]
    both = f'{geom} user="3.5"/>{geom}/>'
    assert losses_db(both, head='<size nuser_geom="1"/>') == [3.5, DEFAULT_LOSS_DB]


@pytest.mark.parametrize("loss", ["-1", "inf"])
def test_losses_below_0_or_without_end_are_refused(loss):
    geom = f'<geom name="wall" type="box" size="1 1 1" group="{OBSTACLE_GROUP}" user="{loss}"/>'
    model = compiled(geom.replace("inf", "0"), head='<size nuser_geom="1"/>')
    model.geom_user[0, 0] = float(loss)
    with pytest.raises(ValueError, match=r"loss of geom wall must be 0 dB or more, not"):
        obstacles_of(model)


def test_a_mesh_is_the_box_around_it():
    mesh = '<asset><mesh name="m" vertex="0 0 0 2 0 0 0 4 0 0 0 6"/></asset>'
    body = f'<geom type="mesh" mesh="m" pos="10 0 0" group="{OBSTACLE_GROUP}"/>'
    model = compiled(body, head=mesh)
    found = obstacles_of(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    corners = model.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    off = (corners - found.centre_m[0]) @ found.rotation[0]
    assert found.kind.tolist() == [BOX]
    np.testing.assert_allclose(off.min(axis=0), -found.size_m[0], atol=1e-6)
    np.testing.assert_allclose(off.max(axis=0), found.size_m[0], atol=1e-6)
