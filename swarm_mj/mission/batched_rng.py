"""Random numbers drawn ahead: one stream per mission, so that batches do not change a mission."""

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

BLOCK = 64  # draws made at once: enough to make the loop over missions cheap

Draw = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]
uniform: Draw = np.random.Generator.random  # on [0, 1)
normal: Draw = np.random.Generator.standard_normal


@runtime_checkable
class Started(Protocol):
    """A component that draws or remembers, and so must know when missions begin."""

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator], /) -> None:
        """Forget earlier missions; there is one generator per mission, the component's own.

        To give a mission the same course in any batch, draw for mission b from the b-th alone.
        """
        ...


class Stream:
    """The same kind of draw from every mission's own generator, one array for all missions.

    Mission b sees the numbers that its generator alone would give, whatever the batch.
    """

    def __init__(
        self, rngs: Sequence[np.random.Generator], draw: Draw, shape: tuple[int, ...]
    ) -> None:
        """Prepare draws of this shape for each mission."""
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
