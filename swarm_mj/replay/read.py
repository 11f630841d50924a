"""Reads a replay back: whether it is whole, and which windows it holds."""

from pathlib import Path

import numpy as np
from jaxtyping import Int
from rerun.chunk import RrdReader

from swarm_mj.replay.digest import has_digest
from swarm_mj.replay.sheet import TIMELINE


def check_replay(path: Path) -> None:
    """Passes for a whole replay; rerun may crash over others, so they are kept from it.

    Raises:
        ValueError: There is no such file, or it is not as `write_replay` left it.
        OSError: The disk fails.
    """
    if not has_digest(path):
        raise ValueError(
            f"{path} is no whole replay: damaged, truncated, or not recorded by this version of "
            f"swarm-mj; record it again, or see by `rerun {path}` what rerun makes of it"
        )


def windows(path: Path) -> Int[np.ndarray, "T"]:
    """The numbers of a whole replay's windows, in order; 1 is a mission's first."""
    chunks = RrdReader(path).stream().filter(content="/arena/robots")
    found = [
        chunk.to_record_batch().column(TIMELINE).to_numpy(zero_copy_only=False)
        for chunk in chunks
        if not chunk.is_static
    ]
    return np.sort(np.concatenate(found)).astype(np.int64)
