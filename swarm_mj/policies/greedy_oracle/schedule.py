"""Schedules from the compiled greedy scheduler, in windows and metres."""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.greedy_oracle.link_scheduler import (
    HALVES,
    NO_PAIR,
    Links,
    first_pairs,
    schedule,
)
from swarm_mj.radio.free_space import MIN_DISTANCE_M, FreeSpaceRadio


def links_between(
    radio: FreeSpaceRadio,
    position_m: Float[np.ndarray, "N 2"],
    spread_m: Float[np.ndarray, "N"] | None = None,
    is_known: Bool[np.ndarray, "N"] | None = None,
) -> Links:
    """The links between robots at believed positions.

    Args:
        radio: The mission's.
        position_m: Where the robots are believed to be [m].
        spread_m: Standard deviation of that belief; None: the positions are true [m].
        is_known: Who is believed to be anywhere; None: everyone. The others hear nothing and are
            not heard.

    Returns:
        The links.
    """
    apart_m = position_m[:, None] - position_m[None, :]
    distance_m = np.maximum(np.sqrt(np.sum(apart_m**2, axis=2)), MIN_DISTANCE_M)
    received_mw = radio.received_at_1_m_mw / distance_m**2
    np.fill_diagonal(received_mw, 0.0)
    if is_known is not None:
        received_mw *= is_known[:, None] & is_known[None, :]
    sharpness = np.full_like(distance_m, np.inf)
    if spread_m is not None:
        variance_m2 = spread_m[:, None] ** 2 + spread_m[None, :] ** 2
        np.divide(distance_m, np.sqrt(variance_m2), out=sharpness, where=variance_m2 > 0.0)
    return Links(received_mw, sharpness, radio.noise_mw, radio.threshold)


def greedy_schedule(
    timestamp: Float[np.ndarray, "N N"],
    now: float,
    links: Links,
    num_windows: int,
    *,
    is_squared: bool,
) -> tuple[Int[np.ndarray, "num_windows N"], Float[np.ndarray, "N N"]]:
    """Whom each robot should address in each of the next windows.

    Args:
        timestamp: T before the first of them [windows].
        now: t before the first of them [windows].
        links: The radio.
        num_windows: How many windows ahead; everyone stands still meanwhile.
        is_squared: Whether rises of T count squared.

    Returns:
        The recipients, itself is silence; and T after the last window, as expected [windows].
    """
    halves = (HALVES * timestamp).astype(np.float32)
    recipient = np.empty((num_windows, len(timestamp)), dtype=np.int64)
    schedule(halves, HALVES * now, links, is_squared, NO_PAIR, 0.0, recipient)
    return recipient, halves.astype(np.float64) / HALVES


def lookahead_window(
    timestamp: Float[np.ndarray, "N N"],
    now: float,
    links: Links,
    *,
    num_branches: int,
    num_windows: int,
) -> Int[np.ndarray, "N"]:
    """Whom each robot should address in the next window, by trying what would come of it.

    Each of the best first pairs is followed by greedy completion and greedy windows, rises of T
    squared; the branch with the least age of information, summed over its windows, wins.

    Args:
        timestamp: T [windows].
        now: t [windows].
        links: The radio.
        num_branches: How many first pairs are tried.
        num_windows: How far each is followed, the window in question included.

    Returns:
        The recipients; itself is silence.
    """
    halves = (HALVES * timestamp).astype(np.float32)
    gain = first_pairs(halves, HALVES * now, links, True).ravel()
    best, most_known = np.arange(len(timestamp)), -np.inf
    for pair in np.argsort(-gain, kind="stable")[:num_branches].tolist():
        if gain[pair] > 0.0:
            branch = np.empty((num_windows, len(timestamp)), dtype=np.int64)
            first = divmod(pair, len(timestamp))
            known = schedule(
                halves.copy(), HALVES * now, links, True, first, float(gain[pair]), branch
            )
            if known > most_known:
                best, most_known = branch[0], known
    return best
