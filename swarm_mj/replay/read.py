"""Reads a replay back: whether it is whole, and which windows it holds."""

import warnings
from pathlib import Path

import numpy as np
from jaxtyping import Int
from rerun.chunk import RrdReader

from swarm_mj.replay.sheet import TIMELINE


def check_replay(path: Path) -> None:
    """Passes for a whole replay.

    Raises:
        ValueError: There is no such file, or it is no recording, or a truncated one.
    """
    if not path.is_file():
        raise ValueError(f"there is no replay {path}; `swarm-mj fly` records one")
    try:
        with warnings.catch_warnings():
            # Of a missing footer; what follows from it is said here.
            warnings.simplefilter("ignore")
            num_recordings = len(RrdReader(path).recordings())
    except Exception as error:
        raise ValueError(f"{path} is no whole replay: truncated, or not an .rrd file") from error
    if num_recordings != 1:
        raise ValueError(f"{path} must hold 1 recording, not {num_recordings}")


def windows(path: Path) -> Int[np.ndarray, "T"]:
    """The numbers of a whole replay's windows, in order; 1 is a mission's first.

    Raises:
        ValueError: The recording is not one of a swarm.
    """
    chunks = RrdReader(path).stream().filter(content="/arena/robots")
    found = [
        chunk.to_record_batch().column(TIMELINE).to_numpy(zero_copy_only=False)
        for chunk in chunks
        if not chunk.is_static
    ]
    if not found:
        raise ValueError(f"{path} shows no robots; it is no replay of swarm_mj")
    return np.sort(np.concatenate(found)).astype(np.int64)
