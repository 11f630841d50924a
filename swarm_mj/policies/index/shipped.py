"""The numbers of `index-csma` that come with the package, in `shipped.toml`."""

import tomllib
from functools import cache
from pathlib import Path

from swarm_mj.policies.index.weights import Weights, from_names
from swarm_mj.system.reading import read_file

SHIPPED = Path(__file__).with_name("shipped.toml")
MAX_BYTES = 100_000


@cache
def shipped_weights() -> Weights:
    """Return the numbers that `training/shipped_index.py` found."""
    return from_names(tomllib.loads(read_file(SHIPPED, "weights", MAX_BYTES).decode())["weights"])
