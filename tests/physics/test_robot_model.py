"""Questions to the compiled model of one robot."""

import mujoco
import numpy as np
import pytest
from robot_files import BODY, LIFT, PLANAR, mjcf

from swarm_mj.physics.robot_model import (
    antenna_offset_m,
    attached,
    base_of,
    collides,
    is_free_base,
    is_motor,
    rest_pose,
)


def spec_of(**parts):
    """A robot's file, without the floor that it is tried on."""
    return mujoco.MjSpec.from_string(mjcf(**parts).replace('<geom type="plane" size="5 5 1"/>', ""))


def test_the_floor_that_a_robot_is_tried_on_is_none_of_it():
    model = mujoco.MjModel.from_xml_string(mjcf())
    assert collides(model).tolist() == [False, True]
    silent = BODY.replace("<geom", '<geom contype="0" conaffinity="0"')
    assert not np.any(collides(mujoco.MjModel.from_xml_string(mjcf(body=silent))))


@pytest.mark.parametrize(("body", "is_free"), [(BODY, True), (PLANAR, False)])
def test_at_rest_a_base_is_level_at_the_origin(body, is_free):
    model = spec_of(body=body).compile()
    assert is_free_base(model) == is_free
    data = rest_pose(model)
    assert data.xquat[1].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert data.xpos[1].tolist() == [0.0, 0.0, 0.0 if is_free else 0.1]  # as in its file


def test_what_is_no_motor_has_a_force_of_its_own():
    servo = LIFT.replace("</actuator>", '<position joint="x" kp="3"/></actuator>')
    model = spec_of(body=PLANAR, actuator=servo).compile()
    assert is_motor(model).tolist() == [True, False]


def test_an_antenna_within_another_body_counts_from_the_base():
    mast = '<body pos="0 0 0.5"><geom size="0.1" mass="0.1"/><site name="antenna" pos="0 0 1"/>'
    body = BODY.replace('<site name="s"/>', f'<site name="s"/>{mast}</body>')
    assert antenna_offset_m(spec_of(body=body).compile()) == pytest.approx([0.0, 0.0, 1.5])
    assert antenna_offset_m(spec_of().compile()).tolist() == [0.0, 0.0, 0.0]


def test_a_robot_is_attached_with_what_refers_to_it_alone():
    scene = mujoco.MjSpec()
    own = spec_of()
    assert base_of(own).name == "base"
    assert attached(scene, own, 7).name == "r7/base"
    model = scene.compile()
    assert model.actuator(0).name == "r7/lift"
    assert model.nbody == 2
