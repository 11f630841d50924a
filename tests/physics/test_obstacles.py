"""Obstacles as arrays: their kinds are MuJoCo's numbers."""

import mujoco

from swarm_mj.physics import obstacles


def test_kinds_are_numbered_as_mujoco_numbers_them():
    for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX"):
        assert getattr(obstacles, name) == getattr(mujoco.mjtGeom, f"mjGEOM_{name}").value
