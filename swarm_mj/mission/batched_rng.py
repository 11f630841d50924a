"""Random numbers of missions: from a seed to a generator for each purpose, and draws ahead.

Each mission has streams of its own, so that the missions beside it do not change it.
"""

import math
from collections.abc import Callable, Sequence
from numbers import Integral
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

MAX_SEED = 2**63 - 1  # the largest that a replay's properties keep
BLOCK = 64  # draws made at once: enough to make the loop over missions cheap

Draw = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]
uniform: Draw = np.random.Generator.random  # on [0, 1)
normal: Draw = np.random.Generator.standard_normal


class Streams(NamedTuple):
    """Each mission's generators, one for each purpose, so that policies meet equal missions.

    A seed spawns them in this order, so new ones go at the end, or all missions would change.
    """

    placement: list[np.random.Generator]
    motion: list[np.random.Generator]
    policy: list[np.random.Generator]
    failures: list[np.random.Generator]
    channel: list[np.random.Generator]
    localisation: list[np.random.Generator]
    sensing: list[np.random.Generator]
    bodies: list[np.random.Generator]
    pilots: list[np.random.Generator]


def streams_of(seeds: Sequence[int]) -> Streams:
    """Return the streams of missions that begin from these seeds."""
    spawned = [np.random.SeedSequence(seed).spawn(len(Streams._fields)) for seed in seeds]
    purposes = zip(*spawned, strict=True)
    return Streams(*([np.random.default_rng(child) for child in each] for each in purposes))


def check_seeds(seeds: Sequence[int], expected: int | None = None) -> None:
    """Raise ValueError unless there are seeds, as many as expected, and none is negative."""
    if not hasattr(seeds, "__len__") or isinstance(seeds, str | bytes):
        raise ValueError(f"seeds must be a list, one per mission, such as [1], not {seeds!r:.80}")
    is_whole = all(
        isinstance(seed, Integral) and not isinstance(seed, bool) and 0 <= seed <= MAX_SEED
        for seed in seeds
    )
    is_right_count = len(seeds) > 0 if expected is None else len(seeds) == expected
    if not is_whole or not is_right_count:
        count = "one or more" if expected is None else str(expected)
        raise ValueError(
            f"seeds must be {count} integers from 0 to {MAX_SEED}, not {list(seeds)!s:.80}"
        )


@runtime_checkable
class Started(Protocol):
    """A component that draws or remembers, and so must know when missions begin."""

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator], /) -> None:
        """Forget earlier missions; there is one generator per mission, the component's own.

        To give a mission the same course in any batch, draw for mission b from the b-th alone.
        """
        ...


class Stream:
    """One array of draws, each mission's from its own generator, whatever missions are with it."""

    def __init__(
        self, rngs: Sequence[np.random.Generator], draw: Draw, shape: tuple[int, ...]
    ) -> None:
        self._rngs = rngs
        self._draw = draw
        self._block = np.empty((BLOCK, len(rngs), *shape))
        self._next = BLOCK

    def next(self) -> Float[np.ndarray, "B ..."]:
        """Return the next draw of every mission; later draws overwrite it, so keep copies."""
        if self._next == BLOCK:
            for b, rng in enumerate(self._rngs):
                self._block[:, b] = self._draw(rng, (BLOCK, *self._block.shape[2:]))
            self._next = 0
        self._next += 1
        return self._block[self._next - 1]


def correlated(
    before: Float[np.ndarray, "*S"], fresh: Float[np.ndarray, "*S"], kept: float
) -> Float[np.ndarray, "*S"]:
    """Return the next values of a first-order Gauss-Markov process, of a constant variance.

    Args:
        before: Those of a step before.
        fresh: Draws of the same variance.
        kept: The share of a value that is left a step later, on [0, 1].
    """
    # The shares' squares add up to 1, so that values stay as large as they are.
    return kept * before + math.sqrt(1.0 - kept**2) * fresh
