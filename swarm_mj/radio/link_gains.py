"""The power that every robot's packets have at every other, where they stand: all that fades leave.

Path loss, obstruction and shadowing follow from positions. They are worked out for those robots
that transmit, once for each place: for a team at rest, once in a mission.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.physics.state import ROBOT_HEIGHT_M, Obstacles
from swarm_mj.radio.obstruction import obstruct
from swarm_mj.radio.power_law import PowerLaw, write_path_loss
from swarm_mj.radio.shadowing import (
    NUM_WAVES,
    STEPS_PER_CORRELATION,
    Shadowing,
    Waves,
    draw_waves,
    set_ends,
    shadowing_neper,
)
from swarm_mj.system.compiled import compiled


class LinkGains:
    """Received powers in B missions of N robots, for one place of the robots at a time."""

    def __init__(self, law: PowerLaw, shadowing: Shadowing | None) -> None:
        """Take what the powers follow from.

        Args:
            law: Powers after one metre [mW], path loss and obstacles.
            shadowing: Its numbers, or None.
        """
        self._law = law
        self._shadowing = shadowing

    def start(self, rngs: Sequence[np.random.Generator]) -> None:
        """Start new missions, each with its own shadowing and its own generator."""
        num_missions, num_robots = len(rngs), len(self._law.at_1_m)
        self._position_m = np.full((num_missions, num_robots, 2), np.nan)
        self._is_done = np.zeros((num_missions, num_robots), dtype=np.bool_)
        self._received_mw = np.zeros((num_missions, num_robots, num_robots))
        if self._shadowing is not None:
            self._waves = draw_waves(self._shadowing, rngs)
            self._step_m = self._shadowing.correlation_m / STEPS_PER_CORRELATION
            self._place = np.full((num_missions, num_robots, 2), np.nan)
            self._ends = np.empty((num_missions, num_robots, 4, NUM_WAVES), dtype=np.float32)

    def received_mw(
        self,
        position_m: Float[np.ndarray, "W N 2"],
        mission: Int[np.ndarray, "W"],
        is_sender: Bool[np.ndarray, "W N"],
    ) -> Float[np.ndarray, "B N N"]:
        """The power of sender i at robot j [mW]; of robots that never sent here it is unspecified.

        Args:
            position_m: Where the robots are; rows of one mission agree [m].
            mission: Of each row.
            is_sender: Whose powers are needed.

        Returns:
            The powers, by missions; overwritten by the next call.
        """
        is_asked = np.zeros_like(self._is_done)
        if _ask(position_m, mission, is_sender, self._position_m, self._is_done, is_asked):
            _lose(self._position_m, is_asked, self._law, self._received_mw)
            if self._shadowing is not None:
                _shadow(
                    self._position_m,
                    is_asked,
                    self._waves,
                    self._step_m,
                    self._shadowing.std_db,
                    self._place,
                    self._ends,
                    self._received_mw,
                )
            _obstruct(self._position_m, is_asked, self._law.obstacles, self._received_mw)
        return self._received_mw


@compiled()
def _ask(
    position_m: Float[np.ndarray, "W N 2"],
    mission: Int[np.ndarray, "W"],
    is_sender: Bool[np.ndarray, "W N"],
    known_m: Float[np.ndarray, "B N 2"],
    is_done: Bool[np.ndarray, "B N"],
    is_asked: Bool[np.ndarray, "B N"],
) -> bool:
    """Mark whose powers are to be worked out: senders that are new where the robots now are."""
    is_any = False
    num_robots = position_m.shape[1]
    for w in range(mission.shape[0]):
        b = mission[w]
        has_moved = False
        for i in range(num_robots):
            for axis in range(2):
                has_moved |= position_m[w, i, axis] != known_m[b, i, axis]
        if has_moved:
            known_m[b] = position_m[w]
            is_done[b] = False
        for i in range(num_robots):
            if is_sender[w, i] and not is_done[b, i]:
                is_done[b, i] = is_asked[b, i] = is_any = True
    return is_any


@compiled()
def _lose(
    position_m: Float[np.ndarray, "B N 2"],
    is_asked: Bool[np.ndarray, "B N"],
    law: PowerLaw,
    received_mw: Float[np.ndarray, "B N N"],
) -> None:
    """What path loss leaves."""
    for b in range(is_asked.shape[0]):
        for i in range(is_asked.shape[1]):
            if is_asked[b, i]:
                write_path_loss(i, position_m[b], law, received_mw[b, i])


@compiled()
def _obstruct(
    position_m: Float[np.ndarray, "B N 2"],
    is_asked: Bool[np.ndarray, "B N"],
    obstacles: Obstacles,
    received_mw: Float[np.ndarray, "B N N"],
) -> None:
    """What obstacles leave."""
    for b in range(is_asked.shape[0]):
        for i in range(is_asked.shape[1]):
            if is_asked[b, i]:
                obstruct(i, position_m[b], ROBOT_HEIGHT_M, obstacles, received_mw[b, i])


@compiled()
def _shadow(
    position_m: Float[np.ndarray, "B N 2"],
    is_asked: Bool[np.ndarray, "B N"],
    waves: Waves,
    step_m: float,
    std_db: float,
    place: Float[np.ndarray, "B N 2"],
    ends: Float32[np.ndarray, "B N 4 W"],
    received_mw: Float[np.ndarray, "B N N"],
) -> None:
    """What shadowing leaves; the waves at a robot are worked out anew when its place changes."""
    num_missions, num_robots = is_asked.shape
    for b in range(num_missions):
        if not np.any(is_asked[b]):
            continue
        for i in range(num_robots):
            x = np.floor(position_m[b, i, 0] / step_m + 0.5)
            y = np.floor(position_m[b, i, 1] / step_m + 0.5)
            if x != place[b, i, 0] or y != place[b, i, 1]:
                place[b, i, 0], place[b, i, 1] = x, y
                set_ends(
                    position_m[b, i],
                    step_m,
                    waves.first_end[b],
                    waves.other_end[b],
                    waves.phase[b],
                    ends[b, i],
                )
        for i in range(num_robots):
            if is_asked[b, i]:
                for j in range(num_robots):
                    neper = shadowing_neper(ends[b, i], ends[b, j], std_db)
                    received_mw[b, i, j] *= np.exp(neper)
