"""Damaged copies of a file, and what programs say of them."""

import importlib.util
import random
import sys
from pathlib import Path

from tries import tries

FLIPS, CUTS = 100, 30
ROOT = Path(__file__).parent.parent.parent
BAD_INPUT = 2


def damaged(whole: bytes):
    """Copies of a file with one bit flipped, then copies that are cut; the same ones each time."""
    rng = random.Random(12)
    for _ in range(tries(FLIPS)):
        copy = bytearray(whole)
        copy[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
        yield bytes(copy)
    for _ in range(tries(CUTS)):
        yield whole[: rng.randrange(len(whole))]


def program(folder, name):
    """A program of `tools/` or `training/`, as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where `swarm_mj.cli.script` looks for it
    spec.loader.exec_module(module)
    return module


def complaint(capsys, code):
    """What was said, if it is one line and nothing else."""
    said = capsys.readouterr()
    assert code == BAD_INPUT, said.err
    assert len(said.err.splitlines()) == 1, said.err
    assert not said.out
    return said.err


def told_or_read(read):
    """What is read; None if it is refused in one line."""
    try:
        return read()
    except ValueError as error:
        said = str(error)
    assert len(said.splitlines()) == 1, said
    return None
