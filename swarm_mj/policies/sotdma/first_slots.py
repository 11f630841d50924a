"""First slots: those of all robots, as each works them out from what it believes at one moment.

In a team that moves everyone believes something else, so there are N times N first slots, and of
200 robots they take half a minute. Most are never needed: a robot's own slot depends on those
before it in the order alone, and most others will have announced another one before a robot asks.
So slots are worked out as far along the order as someone asks, by what was believed at first.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.sotdma.choices import work_out_slots
from swarm_mj.policies.sotdma.frame import Rule
from swarm_mj.radio.power_law import PowerLaw, powers_between


class FirstSlots:
    """The first slots by the beliefs of one moment."""

    def __init__(
        self,
        order: Int[np.ndarray, "N"],
        position_m: Float[np.ndarray, "N N D"],
        is_known: Bool[np.ndarray, "N N"],
        law: PowerLaw,
        rule: Rule,
    ) -> None:
        """Keep what each robot believes now: where the others are, and whom it knows."""
        self._order = order
        self._rule = rule
        self._law = law
        self._place = np.argsort(order)  # of each robot in the order
        self._position_m = position_m.copy()
        self._is_known = is_known.copy()
        self._slots = np.zeros(is_known.shape, dtype=np.int64)
        self._num_done = np.zeros(len(order), dtype=np.int64)  # the first of the order, in each row
        # Robots that believe the same work out the same, so it is done once, in the first's row.
        first: dict[tuple[bytes, bytes], int] = {}
        self._row = np.empty(len(order), dtype=np.int64)
        for i in range(len(order)):
            believed = (position_m[i].tobytes(), is_known[i].tobytes())
            self._row[i] = first.setdefault(believed, i)

    def own(self) -> Int[np.ndarray, "N"]:
        """Return everyone's own first slot, as itself works it out."""
        own = np.zeros(len(self._order), dtype=np.int64)
        for i in range(len(own)):
            wanted = np.arange(len(own)) == i
            own[i] = self.of(i, wanted)[i]
        return own

    def of(self, i: int, wanted: Bool[np.ndarray, "N"]) -> Int[np.ndarray, "N"]:
        """Return the slots as robot i works them out; only those that are wanted are right."""
        row = self._row[i]
        num = int(np.max(self._place[wanted], initial=-1)) + 1
        if num > self._num_done[row]:
            is_known = self._is_known[row]
            work_out_slots(
                slots=self._slots[row],
                done=int(self._num_done[row]),
                num=num,
                order=self._order,
                is_known=is_known,
                power=believed_powers(self._position_m[row], is_known, self._law),
                rule=self._rule,
            )
            self._num_done[row] = num
        return self._slots[row]


def believed_powers(
    position_m: Float[np.ndarray, "N D"], is_known: Bool[np.ndarray, "N"], law: PowerLaw
) -> Float[np.ndarray, "N N"]:
    """Return powers between robots that one robot knows, as it believes [noise]."""
    return powers_between(position_m, law) * is_known[:, None] * is_known[None, :]
