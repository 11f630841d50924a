"""The mission (IV-B): every number of the paper with its unit and source.

Its parts stand in modules of their own, in the order of options and tables: `team`, `transceiver`,
`faults`, `surroundings`, `impairments`, `knowledge`, `bodies`, `dynamics` and `conventions`. The
last has the differences between the paper's text and its authors' code: `presets.paper` follows the
text, `presets.reference` the code.
"""

from dataclasses import dataclass
from typing import Any, get_args

from swarm_mj.mission.bodies import Bodies
from swarm_mj.mission.conventions import Conventions
from swarm_mj.mission.dynamics import Dynamics
from swarm_mj.mission.faults import Faults
from swarm_mj.mission.impairments import Impairments
from swarm_mj.mission.knowledge import NOTHING, Grant, Knowledge, in_order
from swarm_mj.mission.surroundings import OPEN, Surroundings
from swarm_mj.mission.team import Team
from swarm_mj.mission.transceiver import Transceiver
from swarm_mj.system.arguments import check_names
from swarm_mj.system.fields import check, former_names


# A dataclass has its bases' fields from the last base to the first: the team's come first.
@dataclass(frozen=True, kw_only=True)
class Mission(
    Conventions,
    Dynamics,
    Bodies,
    Knowledge,
    Impairments,
    Surroundings,
    Faults,
    Transceiver,
    Team,
):
    """A mission's numbers; the defaults are the paper's text (IV-B).

    Each field says its meaning, unit, range and source. One that has a help text is an option of
    the command line, too: `num_robots` is `--robots`. `paper` and the other presets make missions
    whose fields go together; `Mission(...)` itself takes every field as it is given.

    Raises:
        ValueError: A field is outside its range, or does not go with another; the message names
            the value and the range.
        TypeError: A field is unknown; the message names the one most like it.

    Example:
        >>> mission = Mission(task="stationary", num_robots=90, density_per_km2=10.0)
        >>> mission.side_m  # of the square area [m]
        3000.0
    """

    def __new__(cls, **given: Any) -> "Mission":
        """Refuse unknown fields by a message that names the likely one."""
        check_names("Mission", given, cls.__dataclass_fields__, former_names(cls))
        return super().__new__(cls)

    def __post_init__(self) -> None:
        check(self)
        if not isinstance(self.arena, str):
            raise ValueError(f"arena must be a name, not {self.arena!r:.80}")
        object.__setattr__(self, "prior_knowledge", in_order(self.prior_knowledge))
        if self.grants(NOTHING) and self.prior_knowledge != NOTHING:
            some = ", ".join(get_args(Grant))
            raise ValueError(
                f"prior knowledge must be nothing or some of {some}, not {self.prior_knowledge}"
            )
        if self.physics == "exact" and (self.arena != OPEN or self.collide):
            raise ValueError(
                "exact physics knows no collisions; choose physics contact, or arena open (it is "
                f"{self.arena}) whose robots pass through each other"
            )
        self._check_bodies()
        self._check_sensing()

    def _check_bodies(self) -> None:
        """Raise ValueError for bodies whose numbers are wrong, or that are to move as points."""
        if not isinstance(self.robot, str):
            raise ValueError(f"robot must be a name, not {self.robot!r:.80}")
        _ = self.groups
        if self.physics == "exact" and self.has_bodies:
            raise ValueError(
                f"exact physics is that of points; choose physics contact for robot {self.robot}"
            )

    def _check_sensing(self) -> None:
        """Raise ValueError for what no receiver senses, or minislots that leave no slot."""
        floor_dbm = self.sensing_floor_dbm
        if self.sensing_dbm is not None and self.sensing_dbm < floor_dbm:
            raise ValueError(
                f"sensing threshold must be at least {floor_dbm:g} dBm, below which the noise of "
                f"{self.noise_dbm:g} dBm hides a preamble of {self.sensing_gain_db:g} dB gain, not "
                f"{self.sensing_dbm:g}; choose that or more, or a larger sensing gain"
            )
        if self.contention_s >= self.slot_s:
            raise ValueError(
                f"{self.minislots} minislots of {self.minislot_us:g} µs take "
                f"{1e3 * self.contention_s:g} ms, but a slot has {1e3 * self.slot_s:g} ms; choose "
                "fewer or shorter ones"
            )
