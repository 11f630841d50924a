"""A search by evolution: CMA-ES whose covariance is diagonal.

Ros and Hansen, A simple modification in CMA-ES achieving linear time and space complexity, PPSN X,
2008: the covariance is learned (n + 2) / 3 times as fast as a full one. All other rates are those
of Hansen, The CMA evolution strategy: a tutorial, arXiv 1604.00772, Table 1. A generation draws
candidates around a mean; the better half moves the mean, and what moved it changes the spread of
each number. The state is a few arrays, so that a search goes on from a checkpoint to the last bit;
packages that do the same keep more, and pickle it.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(kw_only=True)
class Search:
    """The state of a search over D numbers, each scaled so that a step of 1 is worth a try."""

    mean: Float[np.ndarray, "D"]
    sigma: float  # the size of steps
    variance: Float[np.ndarray, "D"]  # of each number's steps, over sigma²
    path: Float[np.ndarray, "D"]  # of the mean, by which variances change
    scaled_path: Float[np.ndarray, "D"]  # of the mean in steps of their size, by which sigma does
    generation: int = 0  # generations that have moved it


@dataclass(frozen=True, kw_only=True)
class _Rates:
    """How fast a search learns, by its numbers and candidates; the symbols are the tutorial's."""

    recombination: Float[np.ndarray, "M"]  # w: of the better half, the best first
    effective: float  # mu_eff: how many candidates the mean is of, in effect
    path: float  # c_c
    scaled_path: float  # c_sigma
    damping: float  # d_sigma
    rank_one: float  # c_1
    rank_mu: float  # c_mu


def begin(num_numbers: int, sigma: float) -> Search:
    """Return a search around zero."""
    return Search(
        mean=np.zeros(num_numbers),
        sigma=sigma,
        variance=np.ones(num_numbers),
        path=np.zeros(num_numbers),
        scaled_path=np.zeros(num_numbers),
    )


def ask(search: Search, num_candidates: int, rng: np.random.Generator) -> Float[np.ndarray, "C D"]:
    """Return the candidates of the next generation."""
    steps = rng.standard_normal((num_candidates, len(search.mean)))
    return search.mean + search.sigma * np.sqrt(search.variance) * steps


def tell(
    search: Search, candidates: Float[np.ndarray, "C D"], costs: Float[np.ndarray, "C"]
) -> None:
    """Move a search towards the candidates of the last generation that cost least.

    Args:
        search: It is changed.
        candidates: As `ask` returned them.
        costs: One for each; only their order counts.
    """
    rates = _rates(len(search.mean), len(costs))
    best = np.argsort(costs, kind="stable")[: len(rates.recombination)]
    moved = (candidates[best] - search.mean) / search.sigma
    step = rates.recombination @ moved
    search.mean = search.mean + search.sigma * step
    search.generation += 1

    kept = 1.0 - rates.scaled_path
    gained = math.sqrt(rates.scaled_path * (2.0 - rates.scaled_path) * rates.effective)
    search.scaled_path = kept * search.scaled_path + gained * step / np.sqrt(search.variance)
    length = float(np.linalg.norm(search.scaled_path))
    usual = _usual_length(len(search.mean))
    # While sigma still grows fast, variances do not follow the same path.
    corrected = length / math.sqrt(1.0 - kept ** (2 * search.generation))
    is_steady = corrected < (1.4 + 2.0 / (len(search.mean) + 1.0)) * usual
    gained = math.sqrt(rates.path * (2.0 - rates.path) * rates.effective)
    search.path = (1.0 - rates.path) * search.path + (gained * step if is_steady else 0.0)

    by_path = search.path**2
    if not is_steady:
        by_path += rates.path * (2.0 - rates.path) * search.variance
    by_candidates = rates.recombination @ moved**2
    kept = 1.0 - rates.rank_one - rates.rank_mu
    search.variance = (
        kept * search.variance + rates.rank_one * by_path + rates.rank_mu * by_candidates
    )
    search.sigma *= math.exp(rates.scaled_path / rates.damping * (length / usual - 1.0))


def _usual_length(num_numbers: int) -> float:
    """Return the expected length of a vector of standard normal numbers."""
    n = num_numbers
    return math.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n**2))


def _rates(num_numbers: int, num_candidates: int) -> _Rates:
    """Return the tutorial's rates, with those of a diagonal covariance."""
    n = num_numbers
    better = num_candidates // 2
    falling = math.log((num_candidates + 1.0) / 2.0) - np.log(np.arange(1, better + 1))
    recombination = falling / falling.sum()
    effective = float(1.0 / np.sum(recombination**2))
    scaled_path = (effective + 2.0) / (n + effective + 5.0)
    # Fewer numbers to learn than a full covariance has, so they are learned faster.
    faster = (n + 2.0) / 3.0
    rank_one = faster * 2.0 / ((n + 1.3) ** 2 + effective)
    rank_mu = faster * 2.0 * (effective - 2.0 + 1.0 / effective) / ((n + 2.0) ** 2 + effective)
    return _Rates(
        recombination=recombination,
        effective=effective,
        path=(4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n),
        scaled_path=scaled_path,
        damping=1.0 + 2.0 * max(0.0, math.sqrt((effective - 1.0) / (n + 1.0)) - 1.0) + scaled_path,
        rank_one=min(1.0, rank_one),
        rank_mu=min(1.0 - min(1.0, rank_one), rank_mu),
    )
