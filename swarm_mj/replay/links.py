"""Packets of a log as lines between robots, sorted by window."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.replay.recorder import Log


@runtime_checkable
class Flown(Protocol):
    """The packets of T windows: a log's, or a swarm's last ones."""

    @property
    def recipient(self) -> Int[np.ndarray, "T 2 N"]:
        """S^i in both phases; itself: silent."""
        ...

    @property
    def heard(self) -> Int[np.ndarray, "T 2 N"]:
        """Whom robot j decoded in both phases; itself: nobody."""
        ...

    @property
    def is_broadcast(self) -> bool:
        """Whether packets have no addressee; otherwise the second phase answers the first."""
        ...


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


def fates(flown: Flown) -> dict[str, Links]:
    """Every packet by its fate.

    Addressed packets are delivered, lost, overheard, answered or unanswered. `lost` and
    `unanswered` ones end at the robot they were meant for, which did not decode them; a packet that
    k other robots overheard is k links. Broadcasts have no addressee: `heard` leads to each hearer.
    """
    row, phase, hearer = np.nonzero(flown.heard != np.arange(flown.heard.shape[2]))
    speaker = flown.heard[row, phase, hearer]
    received = (row, speaker, hearer)
    if flown.is_broadcast:
        return {"heard": _links(flown, received, np.ones(len(row), dtype=bool))}
    is_overheard = flown.recipient[row, phase, speaker] != hearer
    row, phase, sender = np.nonzero(_is_sent(flown))
    receiver = flown.recipient[row, phase, sender]
    is_decoded = flown.heard[row, phase, receiver] == sender
    sent, is_request = (row, sender, receiver), phase == 0
    return {
        "delivered": _links(flown, sent, is_request & is_decoded),
        "lost": _links(flown, sent, is_request & ~is_decoded),
        "overheard": _links(flown, received, is_overheard),
        "answered": _links(flown, sent, ~is_request & is_decoded),
        "unanswered": _links(flown, sent, ~is_request & ~is_decoded),
    }


def transmitters(log: Log) -> Bool[np.ndarray, "T N"]:
    """Who sent a request, or a broadcast in either phase."""
    return np.any(_is_sent(log)[:, : 2 if log.is_broadcast else 1], axis=1)


def broadcast_counts(log: Log) -> tuple[Int[np.ndarray, "T"], Int[np.ndarray, "T"]]:
    """How many broadcasts were sent in each window, and how many of them somebody decoded."""
    row, phase, hearer = np.nonzero(log.heard != np.arange(log.heard.shape[2]))
    is_heard = np.zeros(log.heard.shape, dtype=bool)
    is_heard[row, phase, log.heard[row, phase, hearer]] = True
    return np.sum(_is_sent(log), axis=(1, 2)), np.sum(is_heard, axis=(1, 2))


def ends(log: Log, links: Links) -> tuple[Float[np.ndarray, "L 2"], Float[np.ndarray, "L 2"]]:
    """Where the senders and the receivers are [m]."""
    return log.position_m[links.row, links.sender], log.position_m[links.row, links.receiver]


def _is_sent(flown: Flown) -> Bool[np.ndarray, "T 2 N"]:
    return flown.recipient != np.arange(flown.recipient.shape[2])


def _links(flown: Flown, sent: tuple[np.ndarray, ...], chosen: np.ndarray) -> Links:
    row, sender, receiver = (column[chosen] for column in sent)
    return Links(num_windows=len(flown.recipient), row=row, sender=sender, receiver=receiver)
