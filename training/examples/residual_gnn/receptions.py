"""Predictions of one robot: whom each robot decodes in a slot, from where it believes all are."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.power_law import PowerLaw, write_powers
from swarm_mj.radio.reception import NOBODY, Air, add_to_air, incoming_at, is_received, sinr
from swarm_mj.system.compiled import compiled


class PredictedReceptions(NamedTuple):
    """The receptions of a slot at every robot j, as robot i predicts; powers in units of noise."""

    total: Float[np.ndarray, "N"]  # power of all packets at j
    strongest: Float[np.ndarray, "N"]  # of the strongest one
    sender: Int[np.ndarray, "N"]  # whose it is, or `NOBODY`'s
    power: Float[np.ndarray, "N"]  # room for the power of one robot's packets at all others


@compiled()
def empty_receptions(num_robots: int) -> PredictedReceptions:
    """Return room for the predictions of one robot."""
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
    """Predict what all receive if these robots transmit; `predicted` is overwritten."""
    total, strongest, sender, power = predicted
    total[:], strongest[:], sender[:] = 0.0, 0.0, NOBODY
    for o in range(transmits.shape[0]):
        if transmits[o]:
            write_powers(o, position_m, law, power)
            for j in range(power.shape[0]):
                if j != o:
                    add_to_air(Air(total, strongest, sender), o, j, power[j], power[j])


@compiled()
def decoded_by(j: int, predicted: PredictedReceptions, more: float, threshold: float) -> int:
    """Return whom j decodes beside this additional interference, or `NOBODY`."""
    incoming = incoming_at(Air(predicted.total, predicted.strongest, predicted.sender), j)
    interference = incoming.total - incoming.strongest + more
    is_decoded = is_received(sinr(incoming.strongest, interference, 1.0), threshold)
    return incoming.sender if is_decoded else NOBODY
