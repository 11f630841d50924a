"""Whom everyone would decode in a slot, as one robot reckons from where it believes all to be."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.kernels import is_received, sinr
from swarm_mj.radio.power_law import PowerLaw, write_powers
from swarm_mj.system.compiled import compiled

NOBODY = -1


class PredictedReceptions(NamedTuple):
    """What a slot holds for every robot j, as robot i believes; powers in units of the noise."""

    total: Float[np.ndarray, "N"]  # power of all packets at j
    strongest: Float[np.ndarray, "N"]  # of the strongest one
    sender: Int[np.ndarray, "N"]  # whose it is, or `NOBODY`'s
    power: Float[np.ndarray, "N"]  # room for the power of one robot's packets at all others


@compiled()
def empty_receptions(num_robots: int) -> PredictedReceptions:
    """Room for the reckoning of one robot."""
    return PredictedReceptions(
        np.zeros(num_robots),
        np.zeros(num_robots),
        np.full(num_robots, NOBODY),
        np.zeros(num_robots),
    )


@compiled()
def predict_receptions(
    transmits: Bool[np.ndarray, "N"],
    position_m: Float[np.ndarray, "N 2"],
    law: PowerLaw,
    predicted: PredictedReceptions,
) -> None:
    """Works out what all receive if these robots transmit; `predicted` is overwritten."""
    total, strongest, sender, power = predicted
    total[:], strongest[:], sender[:] = 0.0, 0.0, NOBODY
    for o in range(transmits.shape[0]):
        if transmits[o]:
            write_powers(o, position_m, law, power)
            for j in range(power.shape[0]):
                if j != o:
                    total[j] += power[j]
                    if power[j] > strongest[j]:
                        strongest[j], sender[j] = power[j], o


@compiled()
def decoded_by(j: int, predicted: PredictedReceptions, more: float, threshold: float) -> int:
    """Whom j decodes beside so much more interference, or `NOBODY`."""
    strongest = predicted.strongest[j]
    ratio = sinr(strongest, predicted.total[j] - strongest + more, 1.0)
    return predicted.sender[j] if is_received(ratio, threshold) else NOBODY
