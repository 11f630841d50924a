"""A channel from a table of gains between pairs of places, measured or computed by ray tracing.

What differs from free space is interpolated, in dB: gains rise without limit towards a sender, but
what walls, ground and antennas make of them changes slowly from place to place.
"""

import io
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import PLANE
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.effects import BodyAntennas, model_of
from swarm_mj.radio.mission_radio import radio_of, team_antennas
from swarm_mj.radio.reception import MIN_DISTANCE_M
from swarm_mj.system.decibels import from_db, to_db
from swarm_mj.system.reading import open_file

HEADER = "x1_m,y1_m,x2_m,y2_m,gain_db"
NUM_NEAREST = 8  # pairs of the table that a link is interpolated from
MOST_DB = 1000.0  # of a gain, up or down; powers of more are infinite
MOST_M = 1e9  # of a place, from the middle; the squares of more are infinite


class GainTable(ComposedChannel):
    """A mission's radio over the links of a table, which are the same in both directions."""

    def __init__(self, mission: Mission, path: Path) -> None:
        """Read a table.

        Args:
            mission: Whose transmit power, noise, SINR threshold and half duplex it has, and the
                antennas of whose robots add their own gains.
            path: A CSV file: two places [m] and the gain between them [dB] in each row.

        Raises:
            ValueError: There is no such file, it is no such table, or the model of a robot is
                refused.
        """
        from scipy.spatial import KDTree  # slow to import

        radio = radio_of(mission)
        antennas = team_antennas(mission)
        effects = [] if antennas is None else [BodyAntennas(antennas=antennas)]
        model = model_of(radio, mission.num_robots, effects)
        super().__init__(model.law, model.reception, num_axes=mission.num_axes)
        rows = np.empty(0)
        with open_file(path, "table of gains") as file:
            header = file.readline().decode("utf-8-sig").strip()
            content = file.read()
        if header == HEADER and content.strip():  # NumPy warns of what is empty
            rows = np.loadtxt(io.BytesIO(content), delimiter=",", ndmin=2)
        if len(rows) < NUM_NEAREST or not np.all(np.isfinite(rows)):
            least = f"{NUM_NEAREST} rows of finite numbers or more, with -150 dB for no link"
            raise ValueError(f"a table of gains has a first line {HEADER}, then {least}")
        from_x_m, from_y_m, to_x_m, to_y_m, gain_db = rows.T
        ends_m = np.column_stack([from_x_m, from_y_m, to_x_m, to_y_m])
        _check_largest(ends_m, MOST_M, "m")
        _check_largest(np.asarray(gain_db), MOST_DB, "dB")
        received_mw = radio.power_mw * from_db(gain_db)
        distance_m = np.hypot(from_x_m - to_x_m, from_y_m - to_y_m)
        apart_m = np.maximum(distance_m, MIN_DISTANCE_M)
        beyond_db = to_db(received_mw * apart_m**2 / radio.received_at_1_m_mw)
        # Every pair in both directions: the same numbers with its ends exchanged.
        self._beyond_db = np.tile(beyond_db, 2)
        self._pairs = KDTree(np.concatenate([ends_m, np.roll(ends_m, 2, axis=1)]))

    def received_mw(
        self,
        position_m: Float[np.ndarray, "W N D"],
        mission: Int[np.ndarray, "W"],
        is_sender: Bool[np.ndarray, "W N"],
    ) -> Float[np.ndarray, "B N N"]:
        """Return the power of sender i at robot j [mW]; of others, anything."""
        free_mw = super().received_mw(position_m, mission, is_sender)
        power_mw = free_mw.copy()  # rows of one mission write the same powers, not twice the loss
        for b, place_m, sends in zip(mission, position_m, is_sender, strict=True):
            i, j = np.nonzero(sends[:, np.newaxis] & ~np.eye(len(sends), dtype=np.bool_))
            away_m, pair = self._pairs.query(
                np.hstack([place_m[i, :PLANE], place_m[j, :PLANE]]), NUM_NEAREST
            )
            weight = np.maximum(away_m, MIN_DISTANCE_M) ** -2.0  # Shepard 1968
            beyond_db = np.sum(weight * self._beyond_db[pair], axis=1) / np.sum(weight, axis=1)
            power_mw[b, i, j] = free_mw[b, i, j] * from_db(beyond_db)
        return power_mw


def _check_largest(numbers: Float[np.ndarray, "..."], most: float, unit: str) -> None:
    """Raise ValueError for numbers that no link has."""
    largest = np.abs(numbers).max()
    if largest > most:
        raise ValueError(
            f"a table of gains has numbers from {-most:g} to {most:g} {unit}, not {largest:g}; "
            "-150 dB is no link"
        )
