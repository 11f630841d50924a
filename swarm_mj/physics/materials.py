"""The materials of obstacles: the loss of packets that cross one, and their look.

Geoms name their material; those of a user's MJCF file may, too.
"""

from dataclasses import dataclass

DEFAULT_LOSS_DB = 10.0  # of obstacles in a file that neither say their loss nor name a material


@dataclass(frozen=True, kw_only=True)
class Material:
    """A material of obstacles; geoms, those of a file too, name it."""

    name: str
    loss_db: float  # per obstacle crossed [dB]
    rgba: tuple[float, float, float, float]  # red, green, blue and opacity, from 0 to 1
    source: str  # of the loss


BUILDING = Material(
    name="building",
    loss_db=25.0,
    rgba=(0.36, 0.40, 0.47, 1.0),
    source="two outer walls of 7 dB (COST 231 1999, section 4.7) and the rooms between them",
)
LIGHT_WALL = Material(
    name="light wall",
    loss_db=3.4,
    rgba=(0.45, 0.50, 0.58, 1.0),
    source="COST 231 (1999), section 4.7, at 1.8 GHz",
)
HEAVY_WALL = Material(  # for files: no arena of the package has it
    name="heavy wall",
    loss_db=6.9,
    rgba=(0.40, 0.44, 0.52, 1.0),
    source="COST 231 (1999), section 4.7, at 1.8 GHz",
)
TREE = Material(
    name="tree",
    loss_db=6.0,
    rgba=(0.20, 0.38, 0.30, 1.0),
    source="12 m of leaves at about 0.5 dB/m (ITU-R P.833)",
)

# A test finds a material that is left out.
MATERIALS = {each.name: each for each in (BUILDING, LIGHT_WALL, HEAVY_WALL, TREE)}
