"""A copy of a learned planner whose weights are shuffled: does what was learned matter?

    python tools/shuffled_policy.py assets/policies/gnn runs/shuffled --seed 1

Every array's numbers are permuted within the array, so that each keeps its distribution and loses
its meaning. `swarm-mj evaluate --policy gnn runs/shuffled` then flies both.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from swarm_mj.policies.stored_scorer import is_scorer, load_scorer, save_scorer

DONE, BAD_INPUT = 0, 2
CARD = "# A shuffled policy\n\nThe weights of {source}, permuted within each array, seed {seed}.\n"


def shuffle(source: Path, target: Path, seed: int) -> None:
    """Writes the copy.

    Args:
        source: A folder that `training/plan_network.py` wrote.
        target: The copy's folder.
        seed: Of the permutations.

    Raises:
        ValueError: The source is no learned planner, or the target is the source or anything else
            than a learned planner.
        OSError: A folder cannot be read or written.
    """
    if target.resolve() == source.resolve() or (target.exists() and not is_scorer(target)):
        raise ValueError(f"{target} is no copy to replace; name another folder, or remove it")
    rng = np.random.default_rng(seed)
    weights = {
        name: rng.permutation(array.ravel()).reshape(array.shape)
        for name, array in sorted(load_scorer(source).weights.items())
    }
    facts = {"shuffled": str(source), "seed": seed}
    save_scorer(target, weights, facts, CARD.format(source=source, seed=seed))


def main() -> int:
    """Runs the tool; returns its exit code."""
    parser = argparse.ArgumentParser(description="Copy a learned planner with shuffled weights.")
    parser.add_argument("source", type=Path, help="a learned planner's folder")
    parser.add_argument("target", type=Path, help="the copy's folder; replaced if there is one")
    parser.add_argument("--seed", type=int, default=1, help="of the permutations (default: 1)")
    options = parser.parse_args()
    try:
        shuffle(options.source, options.target, options.seed)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"error: {error}\n")
        return BAD_INPUT
    return DONE


if __name__ == "__main__":
    sys.exit(main())
