"""What varies from slot to slot: fast fading of every link, and packets that are lost otherwise.

All of it follows from a mission's key, the slot, the sender and the receiver (`counters`). A fade
holds for a whole slot and is the same in both directions (block fading, reciprocal).
"""

import math
from dataclasses import dataclass

import numpy as np

from swarm_mj.radio.counters import keyed_normals, keyed_uniform, mixed
from swarm_mj.system.compiled import compiled
from swarm_mj.system.fields import check, setting

NO_LINE_OF_SIGHT = 0.0  # K of Rayleigh fading, linear
NO_FADING = math.inf  # K without scattered waves, linear


@dataclass(frozen=True, kw_only=True)
class Bursts:
    """Packets lost in bursts (Gilbert 1960, Elliott 1963), by receiver.

    Each receiver is in a good state or in a bad one, in which it decodes nothing. A mission begins
    in the stationary distribution.

    Raises:
        ValueError: A probability is out of its range, or the two are above 1 together.
    """

    begin: float = setting(label="probability that a burst begins", low=0.0, high=1.0)  # per slot
    end: float = setting(label="probability that a burst ends", low=0.001, high=1.0)  # per slot

    def __post_init__(self) -> None:
        check(self)
        if self.begin + self.end > 1.0:
            raise ValueError(
                "the probabilities that a burst begins and that it ends must be at most 1 "
                f"together, not {self.begin:g} and {self.end:g}; make one smaller"
            )

    @property
    def mean_loss(self) -> float:
        """The share of slots that a receiver is in a burst."""
        return self.begin / (self.begin + self.end) if self.begin > 0.0 else 0.0

    @property
    def mean_slots(self) -> float:
        """How long a burst lasts [slots]."""
        return 1.0 / self.end


NO_BURSTS = Bursts(begin=0.0, end=1.0)


@compiled()
def fade(key: np.uint64, rician_k: float) -> float:
    """Return the power of a fade over its mean, linear [1].

    Args:
        key: Of the link in its slot.
        rician_k: Power of the line of sight over that of all scattered waves, linear (Rice 1948);
            0 is Rayleigh fading.

    Returns:
        The fade; its mean is 1.
    """
    if rician_k == NO_LINE_OF_SIGHT:
        return -math.log(keyed_uniform(key))
    in_phase, quadrature = keyed_normals(key)
    spread = math.sqrt(0.5 / (rician_k + 1.0))
    real = math.sqrt(rician_k / (rician_k + 1.0)) + spread * in_phase
    imaginary = spread * quadrature
    return real * real + imaginary * imaginary


@compiled()
def is_in_burst(key: np.uint64, slot: int, begin: float, end: float) -> bool:
    """Whether a receiver is in a burst.

    A uniform number u decides each slot: below `begin` it is bad and above `1 - end` good, whatever
    it was before; between them it stays what it was. So one looks back until a number decides.

    Args:
        key: Of the receiver.
        slot: Counted from 0, the first of the mission.
        begin: Probability that a burst begins in a slot.
        end: Probability that it ends.

    Returns:
        Whether it decodes nothing in this slot.
    """
    for s in range(slot, 0, -1):
        u = keyed_uniform(mixed(key, np.uint64(s)))
        if u < begin:
            return True
        if u >= 1.0 - end:
            return False
    return keyed_uniform(mixed(key, np.uint64(0))) < begin / (begin + end)
