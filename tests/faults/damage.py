"""Damaged copies of a file: bits that flipped, ends that are gone."""

import random

from tries import tries

FLIPS, CUTS = 300, 100


def damaged(whole: bytes):
    """Copies of a file with one bit flipped, then copies that are cut; the same ones each time."""
    rng = random.Random(12)
    for _ in range(tries(FLIPS)):
        copy = bytearray(whole)
        copy[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
        yield bytes(copy)
    for _ in range(tries(CUTS)):
        yield whole[: rng.randrange(len(whole))]
