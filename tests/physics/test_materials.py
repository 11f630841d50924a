"""The list of materials against those that are declared."""

from swarm_mj.physics import materials
from swarm_mj.physics.materials import MATERIALS, Material


def test_no_material_is_left_out():
    declared = [each for each in vars(materials).values() if isinstance(each, Material)]
    assert list(MATERIALS.values()) == declared
    assert all(name == each.name for name, each in MATERIALS.items())
