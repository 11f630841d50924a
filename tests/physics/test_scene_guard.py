"""Scenes that change what they must leave are refused."""

import mujoco
import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.physics.scene import compose
from swarm_mj.physics.scene_guard import OF_ACTUATORS, OF_JOINTS, OF_OPTIONS

GUARDED = [("joint", name) for name in OF_JOINTS]
GUARDED += [("actuator", name) for name in OF_ACTUATORS]
GUARDED += [("option", name) for name in OF_OPTIONS]


@pytest.mark.parametrize(("part", "name"), GUARDED)
def test_a_scene_that_changes_how_robots_move_is_refused(part, name):
    def meddling(spec, _mission):
        owner = {"joint": spec.joints[0], "actuator": spec.actuators[0], "option": spec.option}
        old = getattr(owner[part], name)
        if np.ndim(old):
            # Some are not a number unless they are given.
            setattr(owner[part], name, np.nan_to_num(np.asarray(old, dtype=float)) + 1.0)
        else:
            setattr(owner[part], name, type(old)(0 if int(old) else 1))  # also of enumerators

    with pytest.raises(ValueError, match=f"must leave how robots move, but changed {name} of"):
        compose(paper("random-walk", num_robots=3, physics="contact"), scene=meddling)


UNNAMED = (
    '<mujoco><worldbody><body><freejoint/><geom size="0.1" mass="0.2"/>'
    '<body pos="0 0 0.2"><joint damping="1"/><geom size="0.1" mass="0.2" contype="0"/></body>'
    '</body></worldbody><actuator><motor site="s"/></actuator></mujoco>'
).replace("<geom", '<site name="s"/><geom', 1)


@pytest.mark.parametrize("i", [0, 1])
def test_a_scene_may_not_change_joints_without_names(tmp_path, i):
    """Whichever robot's, of two whose joints are called nothing."""
    file = tmp_path / "unnamed.xml"
    file.write_text(UNNAMED)
    mission = paper("random-walk", num_robots=2, robot=str(file))

    def braking(spec, _mission):
        spec.joints[2 * i + 1].damping = [5.0, 0.0, 0.0]

    def cutting(spec, _mission):
        spec.delete(spec.actuators[i])

    with pytest.raises(ValueError, match=f"changed damping of joint {2 * i + 1}, which has no"):
        compose(mission, scene=braking)
    with pytest.raises(ValueError, match="removes or renames actuator 1, which has no name"):
        compose(mission, scene=cutting)


@pytest.mark.parametrize(
    ("name", "value"),
    [("size", [10.0, 0.0, 0.0]), ("type", mujoco.mjtGeom.mjGEOM_BOX), ("pos", [0.0, 0.0, 1.0])],
)
def test_a_scene_that_changes_robots_hulls_is_refused(name, value):
    """Collisions and `--collide` are between spheres of one size."""

    def swelling(spec, _mission):
        setattr(spec.geom("r2/hull"), name, value)

    with pytest.raises(ValueError, match=f"must leave the robots' hulls, but changed {name} of r2"):
        compose(paper("random-walk", num_robots=3, collide=True), scene=swelling)


def test_a_scene_that_renames_a_joint_is_refused():
    def renaming(spec, _mission):
        spec.joint("r1/x").name = "mine"

    with pytest.raises(ValueError, match="scene renaming adds joint mine"):
        compose(paper("random-walk", num_robots=3), scene=renaming)


def test_a_scene_that_deletes_a_robot_s_hull_is_refused():
    def robbing(spec, _mission):
        spec.delete(spec.geom("r1/hull"))

    mission = paper("stationary", num_robots=3, physics="contact")
    with pytest.raises(ValueError, match="must leave the robots' hulls, but deleted r1/hull"):
        compose(mission, scene=robbing)
