"""Probabilities that packets decode whose power is not known exactly: by margin and by doubt.

The margin is the SINR of the mean powers over the threshold, in dB. A fade, an error of the belief
in these powers, or both make of the rule of Eq. 4 a probability that rises with the margin.
"""

import math

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.radio.fading import NO_FADING
from swarm_mj.system.compiled import compiled

NUM_RATIOS = 1024  # steps of x = r / (1 + r), where r is the SINR over the threshold
MAX_MARGIN_DB = 80.0  # up to which a fade's own distribution is worked out
FINE_STEP_DB = 0.01  # and how finely
STD_STEP_DB = 0.5
MAX_STD_DB = 12.0
MANY = 100.0  # the K from which a Rician amplitude is normal, to a good approximation
SIGMAS, SIGMA_STEP = 4.0, 0.05  # how far a normal distribution is followed, and how finely
LEAST_PROBABILITY = 0.02  # what is less counts as 0, which spares schedulers hopeless links

Curves = Float[np.ndarray, "S R"]  # a probability for each standard deviation and each SINR

KNOWN = np.zeros((0, 0))  # instead of curves: powers are known but for the positions


def decode_curves(rician_k: float = NO_FADING, success: float = 1.0) -> Curves:
    """Return the probability that a packet decodes, if one of enough power does with `success`.

    Rows are standard deviations of the believed power from 0 to `MAX_STD_DB`. Columns are ratios r
    of the SINR to the threshold from 0 to infinity, evenly spaced in r / (1 + r).
    """
    share = np.arange(NUM_RATIOS + 1) / NUM_RATIOS
    with np.errstate(divide="ignore"):
        margin_db = 10.0 * (np.log10(share) - np.log10(1.0 - share))
    z = np.arange(-SIGMAS, SIGMAS + SIGMA_STEP / 2, SIGMA_STEP)
    weight = np.exp(-0.5 * z**2)
    weight /= weight.sum()
    num_fine = round(MAX_MARGIN_DB / FINE_STEP_DB)
    fine_db = np.arange(-num_fine, num_fine + 1) * FINE_STEP_DB
    exceeds = _fade_exceeds(fine_db, rician_k)
    std_db = STD_STEP_DB * np.arange(round(MAX_STD_DB / STD_STEP_DB) + 1)
    rows = [
        np.interp(margin_db[:, None] + std * z[None, :], fine_db, exceeds) @ weight
        for std in std_db.tolist()
    ]
    curves = success * np.stack(rows)
    return np.where(curves < LEAST_PROBABILITY, 0.0, curves)


def row_of(std_db: Float[np.ndarray, "N N"]) -> Int[np.ndarray, "N N"]:
    """Return the row of `decode_curves` that is nearest to a standard deviation [dB]."""
    return np.rint(np.minimum(std_db, MAX_STD_DB) / STD_STEP_DB).astype(np.int64)


@compiled()
def probability_at(curves: Curves, row: int, ratio: float) -> float:
    """Return the probability that a packet decodes; the ratio is SINR to threshold, linear [1]."""
    return curves[row, int(ratio / (1.0 + ratio) * NUM_RATIOS + 0.5)]


def _fade_exceeds(margin_db: Float[np.ndarray, "M"], rician_k: float) -> Float[np.ndarray, "M"]:
    """Return the probability that a fade leaves more than what a margin can spare."""
    least = 10.0 ** (-margin_db / 10.0)  # of the mean power
    if rician_k == NO_FADING:
        return (least <= 1.0).astype(np.float64)
    if rician_k > MANY:
        z = (np.sqrt(least) - 1.0) * math.sqrt(2.0 * rician_k)
        return np.array([0.5 * math.erfc(value / math.sqrt(2.0)) for value in z.tolist()])
    # The Marcum Q function Q_1, as a mixture of Poisson's distributions.
    count = np.arange(int(rician_k + 12.0 * math.sqrt(rician_k) + 30.0))
    log_factorial = np.array([math.lgamma(n + 1.0) for n in count.tolist()])
    no_sight = np.where(count == 0, 0.0, -np.inf)  # as 0^0 is 1
    log_power = count * math.log(rician_k) if rician_k > 0.0 else no_sight
    of_sight = np.exp(-rician_k + log_power - log_factorial)
    y = ((1.0 + rician_k) * least)[:, None]
    of_scatter = np.exp(-y + count * np.log(y) - log_factorial)
    return np.cumsum(of_scatter, axis=1) @ of_sight
