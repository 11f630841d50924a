"""Damaged copies of a file, and what programs say of them."""

import importlib.util
import os
import random
import sys
from pathlib import Path

FLIPS, CUTS = 100, 30
ROOT = Path(__file__).parent.parent.parent
RESULTS = ROOT / "training" / "results"
BAD_INPUT = 2


def damaged(path, tries, crafted=()):
    """Writes damaged copies in place of a file, the same ones each time, after crafted ones."""
    rng, whole = random.Random(12), path.read_bytes()
    copies = list(crafted)
    for _ in range(tries(FLIPS)):
        copy = bytearray(whole)
        copy[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
        copies.append(bytes(copy))
    copies += [whole[: rng.randrange(len(whole))] for _ in range(tries(CUTS))]
    for content in copies:
        path.write_bytes(content)
        yield content


def program(folder, name):
    """A program of `tools/` or `training/`, as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where `swarm_mj.cli.script` looks for it
    spec.loader.exec_module(module)
    return module


def put_no_file(path, kind):
    """Puts a device, a pipe, a folder or a link to itself in a file's place."""
    if kind in ("device", "loop"):
        path.symlink_to("/dev/zero" if kind == "device" else path)
    else:
        os.mkfifo(path) if kind == "pipe" else path.mkdir()


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
