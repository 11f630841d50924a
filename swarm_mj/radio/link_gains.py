"""The power that every robot's packets have at every other, where they stand: all that fades leave.

Path loss, obstruction and shadowing follow from positions. They are computed for those robots
that transmit, once for each place: for a team at rest, once in a mission.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.physics.state import ROBOT_HEIGHT_M
from swarm_mj.radio.obstruction import obstruct
from swarm_mj.radio.power_law import PowerLaw, write_path_loss
from swarm_mj.radio.shadowing import Shadowing, Waves, draw_waves, follow_robots, shadow
from swarm_mj.system.compiled import compiled


class LinkGains:
    """Received powers in B missions of N robots, for one place of the robots at a time."""

    def __init__(self, law: PowerLaw, shadowing: Shadowing | None) -> None:
        """Take what the powers follow from: a law in mW, and shadowing or None."""
        self._law = law
        self._shadowing = shadowing

    def start(self, rngs: Sequence[np.random.Generator]) -> None:
        """Start new missions, each with its own shadowing and its own generator."""
        num_missions, num_robots = len(rngs), len(self._law.at_1_m)
        self._position_m = np.full((num_missions, num_robots, 2), np.nan)
        self._is_done = np.zeros((num_missions, num_robots), dtype=np.bool_)
        self._received_mw = np.zeros((num_missions, num_robots, num_robots))
        drawn = self._shadowing
        self._waves = None if drawn is None else draw_waves(drawn, num_robots, rngs)

    def received_mw(
        self,
        position_m: Float[np.ndarray, "W N 2"],
        mission: Int[np.ndarray, "W"],
        is_sender: Bool[np.ndarray, "W N"],
    ) -> Float[np.ndarray, "B N N"]:
        """Return the power of sender i at robot j [mW]; of robots that never sent, anything.

        Args:
            position_m: Where the robots are; rows of one mission agree [m].
            mission: Of each row.
            is_sender: Whose powers are needed.

        Returns:
            The powers, by missions; overwritten by the next call.
        """
        is_asked = np.zeros_like(self._is_done)
        if _ask(position_m, mission, is_sender, self._position_m, self._is_done, is_asked):
            _compute(self._position_m, is_asked, self._law, self._waves, self._received_mw)
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
    """Mark whose powers are to be computed: senders that are new where the robots now are."""
    is_any = False
    num_robots = position_m.shape[1]
    for w in range(mission.shape[0]):
        b = mission[w]
        has_moved = False
        for i in range(num_robots):
            for axis in range(2):
                has_moved |= position_m[w, i, axis] != known_m[b, i, axis]
        if has_moved:  # any one of them: powers at a robot that moved change, too
            known_m[b] = position_m[w]
            is_done[b] = False
        for i in range(num_robots):
            if is_sender[w, i] and not is_done[b, i]:
                is_done[b, i] = is_asked[b, i] = is_any = True
    return is_any


@compiled()
def _compute(
    position_m: Float[np.ndarray, "B N 2"],
    is_asked: Bool[np.ndarray, "B N"],
    law: PowerLaw,
    waves: Waves | None,
    received_mw: Float[np.ndarray, "B N N"],
) -> None:
    """Write the powers of these robots; without waves, code for shadowing is not even compiled."""
    num_missions, num_robots = is_asked.shape
    for b in range(num_missions):
        if waves is not None and np.any(is_asked[b]):
            follow_robots(waves, b, position_m[b])
        for i in range(num_robots):
            if is_asked[b, i]:
                power_mw = received_mw[b, i]
                write_path_loss(i, position_m[b], law, power_mw)
                if waves is not None:
                    shadow(waves, b, i, power_mw)
                obstruct(i, position_m[b], ROBOT_HEIGHT_M, law.obstacles, power_mw)
