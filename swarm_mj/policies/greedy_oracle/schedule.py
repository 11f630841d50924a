"""Schedules from the compiled greedy scheduler, in windows and metres."""

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.policies.greedy_oracle.link_scheduler import (
    NO_PAIR,
    first_pairs,
    schedule,
)
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.links import Links


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
    slots = (SLOTS_PER_WINDOW * timestamp).astype(np.float32)
    recipient = np.empty((num_windows, len(timestamp)), dtype=np.int64)
    schedule(slots, SLOTS_PER_WINDOW * now, links, is_squared, NO_PAIR, 0.0, recipient)
    return recipient, slots.astype(np.float64) / SLOTS_PER_WINDOW


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
    slots = (SLOTS_PER_WINDOW * timestamp).astype(np.float32)
    gain = first_pairs(slots, SLOTS_PER_WINDOW * now, links, True).ravel()
    best, most_known = np.arange(len(timestamp)), -np.inf
    for pair in np.argsort(-gain, kind="stable")[:num_branches].tolist():
        if gain[pair] > 0.0:
            branch = np.empty((num_windows, len(timestamp)), dtype=np.int64)
            first = divmod(pair, len(timestamp))
            known = schedule(
                slots.copy(), SLOTS_PER_WINDOW * now, links, True, first, float(gain[pair]), branch
            )
            if known > most_known:
                best, most_known = branch[0], known
    return best
