"""Ratios and powers in decibels, and linear ones."""

import math
from typing import overload

import numpy as np

DB_PER_NEPER = 10.0 / math.log(10.0)  # of a power; of an amplitude or a free-space distance twice


@overload
def from_db(ratio_db: float) -> float: ...
@overload
def from_db(ratio_db: np.ndarray) -> np.ndarray: ...
def from_db(ratio_db: float | np.ndarray) -> float | np.ndarray:
    """Return ratios in dB as linear ones; powers in dBm as mW."""
    return 10.0 ** (ratio_db / 10.0)


def to_db(ratio: np.ndarray) -> np.ndarray:
    """Return linear ratios, above 0, in dB; powers in mW as dBm."""
    return 10.0 * np.log10(ratio)
