"""How often the fault suite tries: a little in every test run, a lot under `make attack`."""

import os

FACTOR = float(os.environ.get("SWARM_MJ_TRIES", "1"))


def tries(usual: int) -> int:
    """So many tries; under `make attack`, many times as many."""
    return max(1, round(usual * FACTOR))
