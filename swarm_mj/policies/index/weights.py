"""The learned numbers of `index-csma`: by name, and in a row for the search that finds them.

A feature's weights are linear, so each can be read: the index of a robot whose feature rises by one
rises by the feature's weight, in octaves of news.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32

NUM_SHIFTS = 6  # slots after which the usual shifts of the sensed power begin anew


class Features(NamedTuple):
    """A robot's situation as it sees it, each number about 0 at usual and of the size 1."""

    neighbours: float  # octaves of their number
    since_sent: float  # octaves of the time since its own last packet
    edge: float  # 0.5 at the edge of the robots that it knows, -0.5 amid them
    age: float  # octaves of the mean age of its buffer
    sent: float  # share of the last slots or so in which it sent
    decoded: float  # share of the last slots or so in which it decoded a packet
    team: float  # octaves of the size of the team
    one_neighbour: float  # octaves of the largest share that one neighbour has of the gain
    crowd: float  # neighbours over the size of the team
    news: float  # octaves of what it learned since its last packet, over the gain


FEATURES = Features._fields
NUM_FEATURES = len(FEATURES)


class Weights(NamedTuple):
    """The learned numbers of B missions, which may differ in them.

    A team flies with one row. While numbers are searched for, those of every candidate fly side by
    side.
    """

    # What a packet that it sent brought to each neighbour in reach: this share of what it held.
    success: Float[np.ndarray, "B 1"]
    reach: Float[np.ndarray, "B 1"]  # distance at which every second link is one [ranges]
    # Distance from a sender that the robot decoded at which every second neighbour did, too.
    shared: Float[np.ndarray, "B 1"]  # [ranges]
    stranger: Float[np.ndarray, "B 1"]  # weight of the gain of robots never heard of
    first: Float[np.ndarray, "B 1"]  # index from which a robot begins in the first minislot
    octaves: Float[np.ndarray, "B 1"]  # of the index, between the first minislot and the last
    drawn: Float[np.ndarray, "B 1"]  # share of the minislots that a draw adds at most
    threshold: Float[np.ndarray, "B 1"]  # octaves of gain below which a robot is silent
    softness: Float[np.ndarray, "B 1"]  # of that, the scale of a logistic draw [octaves]
    shift_db: Float[np.ndarray, "B S"]  # by which a channel may be louder, slot by slot [dB]
    in_index: Float[np.ndarray, "B F"]  # of features in the index [octaves]
    in_silence: Float[np.ndarray, "B F"]  # in the gain that counts for silence [octaves]
    in_sensing_db: Float[np.ndarray, "B F"]  # in the power that it takes for a busy channel [dB]


# Where a search begins: what a shorter one had come to, rounded.
START = Weights(
    success=np.array([[0.7]]),
    reach=np.array([[1.08]]),
    shared=np.array([[1.05]]),
    stranger=np.array([[3.4]]),
    first=np.array([[2.7]]),
    octaves=np.array([[8.4]]),
    drawn=np.array([[0.06]]),
    threshold=np.array([[-1.2]]),
    softness=np.array([[0.3]]),
    shift_db=np.array([[2.0, 1.5, 0.0, 0.0, 0.5, 0.5]]),
    in_index=np.array(
        [
            Features(
                neighbours=0.3,
                since_sent=0.35,
                edge=0.2,
                age=-0.7,
                sent=0.6,
                decoded=0.3,
                team=0.7,
                one_neighbour=0.0,
                crowd=-0.7,
                news=0.1,
            )
        ]
    ),
    in_silence=np.array(
        [
            Features(
                neighbours=-0.1,
                since_sent=-0.1,
                edge=0.4,
                age=-0.1,
                sent=0.0,
                decoded=0.2,
                team=0.0,
                one_neighbour=0.0,
                crowd=0.1,
                news=0.4,
            )
        ]
    ),
    in_sensing_db=np.array(
        [
            Features(
                neighbours=0.1,
                since_sent=0.4,
                edge=0.9,
                age=-0.9,
                sent=0.2,
                decoded=-0.5,
                team=0.0,
                one_neighbour=-0.8,
                crowd=-0.3,
                news=-0.2,
            )
        ]
    ),
)
# The size of a step that is worth a try, number by number.
STEPS = Weights(
    success=np.array([[0.1]]),
    reach=np.array([[0.05]]),
    shared=np.array([[0.07]]),
    stranger=np.array([[1.0]]),
    first=np.array([[0.7]]),
    octaves=np.array([[1.0]]),
    drawn=np.array([[0.03]]),
    threshold=np.array([[0.6]]),
    softness=np.array([[0.2]]),
    shift_db=np.full((1, NUM_SHIFTS), 1.5),
    in_index=np.full((1, NUM_FEATURES), 0.15),
    in_silence=np.full((1, NUM_FEATURES), 0.25),
    in_sensing_db=np.full((1, NUM_FEATURES), 0.7),
)
# What numbers may be; all others are free. Storing them in single precision moves none of them.
LEAST = {
    "success": 0.3,
    "reach": 0.6,
    "shared": 0.5,
    "stranger": 0.5,
    "octaves": 2.0,
    "drawn": 0.0,
    "softness": 0.0,
}
MOST = {"success": 1.0, "reach": 1.1, "shared": 1.4, "octaves": 24.0, "drawn": 1.0}
NUMBERS = sum(values.shape[1] for values in START)


def flat(weights: Weights) -> Float[np.ndarray, "B D"]:
    """Return all numbers of each row, side by side in the order of the fields."""
    return np.concatenate(weights, axis=1)


def from_flat(numbers: Float[np.ndarray, "B D"]) -> Weights:
    """Return what `flat` was made of, with each number moved to what it may be."""
    ends = np.cumsum([values.shape[1] for values in START])
    fields = np.split(np.asarray(numbers, dtype=np.float64), ends[:-1], axis=1)
    parts: list[np.ndarray] = []
    for name, values in zip(Weights._fields, fields, strict=True):
        bounded = np.clip(values, *bounds_of(name))
        if name == "in_silence":
            # A team's size is no reason to be silent: teams larger than any trained on never began.
            bounded[:, FEATURES.index("team")] = 0.0
        parts.append(np.ascontiguousarray(bounded))
    return Weights(*parts)


def bounds_of(name: str) -> tuple[np.float32, np.float32]:
    """Return the least and the greatest value that a field's numbers may have, as stored."""
    return np.float32(LEAST.get(name, -np.inf)), np.float32(MOST.get(name, np.inf))


def check_weights(weights: Weights) -> None:
    """Raise ValueError for numbers that no search returns: robots with them may never begin."""
    for name, values in weights._asdict().items():
        least, most = bounds_of(name)
        if np.any(values < least) or np.any(values > most):
            raise ValueError(f"its {name} must be from {least:g} to {most:g}, not {values[0]}")
    of_team = weights.in_silence[:, FEATURES.index("team")]
    if np.any(of_team != 0.0):
        raise ValueError(f"its weight of the team's size in silence must be 0, not {of_team[0]:g}")


def as_tensors(weights: Weights) -> dict[str, Float32[np.ndarray, "..."]]:
    """Return the first row as policies are stored: arrays of single precision by their names."""
    return {name: values[0].astype(np.float32) for name, values in weights._asdict().items()}


def from_tensors(tensors: Mapping[str, np.ndarray]) -> Weights:
    """Return what `as_tensors` was made of, to single precision.

    Raises ValueError as `check_weights` does.
    """
    weights = Weights(*(tensors[name][None].astype(np.float64) for name in Weights._fields))
    check_weights(weights)
    return weights


def repeated(weights: Weights, num_missions: int) -> Weights:
    """Return the same for this many missions: each row as often as the others, one by one."""
    times, rest = divmod(num_missions, len(weights.first))
    if rest:
        raise ValueError(
            f"{num_missions} missions cannot fly as often by each of {len(weights.first)} rows"
        )
    return Weights(*(np.repeat(values, times, axis=0) for values in weights))


def by_name(weights: Weights) -> dict[str, dict[str, float] | list[float] | float]:
    """Return the first row as plain numbers by their names, for a file that people read."""
    named: dict[str, dict[str, float] | list[float] | float] = {}
    for name, values in weights._asdict().items():
        row = [float(value) for value in values[0]]
        if len(row) == NUM_FEATURES:
            named[name] = dict(zip(FEATURES, row, strict=True))
        else:
            named[name] = row if len(row) > 1 else row[0]
    return named


def from_names(named: dict[str, dict[str, float] | Sequence[float] | float]) -> Weights:
    """Return what `by_name` was made of; KeyError if a number is missing."""
    rows: list[np.ndarray] = []
    for name in Weights._fields:
        value = named[name]
        if isinstance(value, dict):
            value = [value[feature] for feature in FEATURES]
        rows.append(np.atleast_1d(np.asarray(value, dtype=np.float64))[None])
    return Weights(*rows)
