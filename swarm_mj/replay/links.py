"""Packets of a log as lines between robots, sorted by window."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.replay.recorder import Log


@dataclass(frozen=True, kw_only=True)
class Links:
    """L packets with the same fate."""

    num_windows: int  # T
    row: Int[np.ndarray, "L"]  # the log's window, 0 to T - 1, ascending
    sender: Int[np.ndarray, "L"]
    receiver: Int[np.ndarray, "L"]

    @property
    def per_window(self) -> Int[np.ndarray, "T"]:
        """How many there are in each window."""
        return np.bincount(self.row, minlength=self.num_windows)


def fates(log: Log) -> dict[str, Links]:
    """Every packet by its fate: delivered, lost, overheard, answered, unanswered.

    `lost` and `unanswered` packets end at the robot they were meant for, which did not decode them;
    a packet that k other robots overheard is k links.

    Args:
        log: The flight.

    Returns:
        The links of each fate.
    """
    row, phase, sender = np.nonzero(log.recipient != np.arange(log.recipient.shape[2]))
    receiver = log.recipient[row, phase, sender]
    is_decoded = log.heard[row, phase, receiver] == sender
    is_request = (phase == 0) | (not log.has_response)
    sent = (row, sender, receiver)
    hearer_row, hearer_phase, hearer = np.nonzero(log.heard != np.arange(log.heard.shape[2]))
    heard_from = log.heard[hearer_row, hearer_phase, hearer]
    is_overheard = log.recipient[hearer_row, hearer_phase, heard_from] != hearer
    return {
        "delivered": _links(log, sent, is_request & is_decoded),
        "lost": _links(log, sent, is_request & ~is_decoded),
        "overheard": _links(log, (hearer_row, heard_from, hearer), is_overheard),
        "answered": _links(log, sent, ~is_request & is_decoded),
        "unanswered": _links(log, sent, ~is_request & ~is_decoded),
    }


def ends(log: Log, links: Links) -> tuple[Float[np.ndarray, "L 2"], Float[np.ndarray, "L 2"]]:
    """Where the senders and the receivers are [m]."""
    return log.position_m[links.row, links.sender], log.position_m[links.row, links.receiver]


def _links(log: Log, sent: tuple[np.ndarray, ...], chosen: np.ndarray) -> Links:
    row, sender, receiver = (column[chosen] for column in sent)
    return Links(num_windows=len(log.window), row=row, sender=sender, receiver=receiver)
