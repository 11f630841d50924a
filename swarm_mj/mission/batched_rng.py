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
    """A part of the swarm that draws or remembers, and so is told when missions begin."""

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator], /) -> None:
        """Forgets earlier missions.

        Args:
            num_robots: N.
            rngs: One generator per mission, the part's own; whoever draws for mission b from the
                b-th alone gives a mission the same course whatever missions stand beside it.
        """
        ...


class Stream:
    """The same kind of draw from every mission's own generator, one array for all missions.

    Mission b sees the numbers that its generator alone would give, whatever missions stand beside
    it.
    """

    def __init__(
        self, rngs: Sequence[np.random.Generator], draw: Draw, shape: tuple[int, ...]
    ) -> None:
        """Prepare the stream.

        Args:
            rngs: One generator per mission.
            draw: Takes a generator and a shape, returns that many independent numbers.
            shape: Of one mission's draw.
        """
        self._rngs = rngs
        self._draw = draw
        self._block = np.empty((BLOCK, len(rngs), *shape))
        self._next = BLOCK

    def next(self) -> Float[np.ndarray, "B ..."]:
        """The next draw of every mission; later draws overwrite it, so copy what you keep."""
        if self._next == BLOCK:
            shape = (BLOCK, *self._block.shape[2:])
            for b, rng in enumerate(self._rngs):
                self._block[:, b] = self._draw(rng, shape)
            self._next = 0
        self._next += 1
        return self._block[self._next - 1]
