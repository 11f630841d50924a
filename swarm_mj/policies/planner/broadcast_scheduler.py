"""Schedules of broadcasts: who transmits in each slot, chosen greedily, looking ahead.

A slot's transmitters are added one by one: always the one whose packet raises the slot's value
most, while that keeps at least a share of the value before. A share below 1 lets robots far apart
transmit at once: less valuable at that moment, but news then travels on many ways. Looking ahead,
several first transmitters are followed for a few slots, and the one that leaves the team youngest
is taken.

A packet has the value of its news (`news`) times the probability that it decodes; timestamps are
expected ones. Index order: `i` sends, `j` receives. Times are in slots, float32, which keeps them
exact for 8 million windows.

The first flight compiles these functions, so there are few, and they write loops where an array
expression or a sort would take numba seconds to compile. They fill arrays that they are given, as
counting references to arrays takes longer than the search.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.policies.planner.news import value_of_news
from swarm_mj.protocol.timestamps import merge_expected, observe_own
from swarm_mj.radio.links import (
    ROUNDING,
    Links,
    broadcast,
    chance_of_strongest,
    incoming_with,
    listen,
    room_for_interference,
)
from swarm_mj.radio.reception import NOBODY, Air, incoming_at
from swarm_mj.system.compiled import compiled


class Problem(NamedTuple):
    """All that schedules over the same links follow from, but T, t and the slots that are free."""

    links: Links
    lone: Float[np.ndarray, "N N"]  # probability that j decodes i when nobody else transmits
    weight: Float32[np.ndarray, "N N"]  # of a squared rise of T, by receiver j and subject k
    min_share: float  # of a slot's value that must remain when a transmitter is added
    width: int  # first transmitters that are tried; 1: none but the best
    depth: int  # how long each is followed, the slot in question included [slots]


class _Search(NamedTuple):
    """The arrays that a search fills, so that its loops need not make any."""

    branch: Float32[np.ndarray, "N N"]  # T of one of the first transmitters that are tried
    alone: Float[np.ndarray, "N"]  # value of the first slot if i transmits alone
    gain: Float[np.ndarray, "N N"]  # value of j decoding i, where it can
    has_news: Bool[np.ndarray, "N"]  # for anyone
    listens: Bool[np.ndarray, "N"]  # those that do not transmit
    air: Air
    # Of the packet that j may decode by this air, and its bounds when i transmits, too:
    value: Float[np.ndarray, "N"]  # or 0 if it is less
    rival_mw: Float[np.ndarray, "N"]  # power above which j may decode i instead; inf: never
    room_mw: Float[np.ndarray, "N"]  # interference above which j decodes nothing
    heard: Int[np.ndarray, "N"]  # in the end, as in `listen`
    probability: Float[np.ndarray, "N"]


def schedule_slot(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    problem: Problem,
    is_free: Bool[np.ndarray, "depth"],
) -> Bool[np.ndarray, "N"]:
    """Return who transmits in the slot that ends now, and bring `timestamp` to its end.

    Slots that are not free, this one or one of those looked ahead to, are silent.
    """
    num_robots = len(timestamp)
    search = _Search(
        branch=np.empty_like(timestamp),
        alone=np.empty(num_robots),
        gain=np.empty_like(problem.lone),
        has_news=np.empty(num_robots, dtype=np.bool_),
        listens=np.empty(num_robots, dtype=np.bool_),
        air=Air(
            total=np.empty(num_robots),
            strongest=np.empty(num_robots),
            sender=np.empty(num_robots, dtype=np.int64),
        ),
        value=np.empty(num_robots),
        rival_mw=np.empty(num_robots),
        room_mw=np.empty(num_robots),
        heard=np.empty(num_robots, dtype=np.int64),
        probability=np.empty(num_robots),
    )
    _schedule(timestamp, now, problem, is_free, search)
    return ~search.listens


@compiled(makes_arrays=False)
def _schedule(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    problem: Problem,
    is_free: Bool[np.ndarray, "depth"],
    search: _Search,
) -> None:
    """Choose a slot's transmitters, the first one by whose branch most is known."""
    num_robots = timestamp.shape[0]
    alone = search.alone
    observe_own(timestamp, now)
    _write_gains(timestamp, problem, search)
    for i in range(num_robots):
        alone[i] = 0.0
        for j in range(num_robots):
            alone[i] += search.gain[i, j] * problem.lone[i, j]
    best = NOBODY
    most_known = -np.inf
    num_tried = 0
    # In a slot that is not free nobody transmits, so there is nothing to try.
    if problem.width > 1 and is_free[0]:
        num_tried = problem.width
    for _ in range(num_tried):
        first = int(np.argmax(alone))
        if alone[first] <= 0.0:
            break
        alone[first] = 0.0
        _copy(timestamp, search.branch)
        known = _follow(search.branch, now, problem, first, is_free, search)
        if known > most_known:
            best = first
            most_known = known
    _follow(timestamp, now, problem, best, is_free[:1], search)


@compiled(makes_arrays=False)
def _copy(timestamp: Float32[np.ndarray, "N N"], branch: Float32[np.ndarray, "N N"]) -> None:
    for i in range(timestamp.shape[0]):
        for k in range(timestamp.shape[1]):
            branch[i, k] = timestamp[i, k]


@compiled(makes_arrays=False)
def _follow(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    problem: Problem,
    first: int,
    is_free: Bool[np.ndarray, "P"],
    search: _Search,
) -> float:
    """Bring `timestamp` to the end of slots, of which the first begins with this transmitter.

    Return the sum of all timestamps after each of them; who transmits in the last is in `search`.
    """
    known = 0.0
    for p in range(is_free.shape[0]):
        observe_own(timestamp, now + p)
        for i in range(timestamp.shape[0]):
            search.listens[i] = True
        if is_free[p]:
            # The first transmitter is given of the first slot only; later ones are chosen freely.
            _choose(timestamp, problem, first if p == 0 else NOBODY, search)
        total = np.float32(0.0)
        for i in range(timestamp.shape[0]):
            for k in range(timestamp.shape[0]):
                total += timestamp[i, k]
        known += float(total)
    return known


@compiled(makes_arrays=False)
def _choose(
    timestamp: Float32[np.ndarray, "N N"], problem: Problem, first: int, search: _Search
) -> None:
    """Choose a slot's transmitters, a given first one among them, and bring T to its end."""
    links = problem.links
    air = search.air
    listens = search.listens
    _write_gains(timestamp, problem, search)
    _sum_air(links, search)
    best, value = _best_addition(problem, search, first, 0.0)
    while best != NOBODY:
        listens[best] = False
        broadcast(links, air, best)
        best, value = _best_addition(problem, search, NOBODY, value * problem.min_share)
    # The sum of powers anew, since its rounding depends on the order of the transmitters.
    _sum_air(links, search)
    listen(links, air, NOBODY, listens, search.heard, search.probability)
    # In place: a robot that transmits decodes nothing, so its row is as it was sent.
    merge_expected(timestamp, search.heard, search.probability, timestamp)


@compiled(makes_arrays=False)
def _sum_air(links: Links, search: _Search) -> None:
    """Add up all packets in the air, in the order of their senders."""
    air = search.air
    for j in range(search.listens.shape[0]):
        air.total[j] = 0.0
        air.strongest[j] = 0.0
        air.sender[j] = j
    for i in range(search.listens.shape[0]):
        if not search.listens[i]:
            broadcast(links, air, i)


@compiled(makes_arrays=False)
def _best_addition(problem: Problem, search: _Search, only: int, least: float) -> tuple[int, float]:
    """Return who raises the slot's value most if it transmits, too, and that value.

    That is `NOBODY` where no value is above the least. Of robots that are as good, it is the first.
    If it is said who may, nobody else is tried.
    """
    links = problem.links
    num_robots = search.listens.shape[0]
    # What each receiver is worth now, and how much more power would change that: by these bounds
    # most candidates are ruled out, so their packets need not be added up at every receiver.
    for j in range(num_robots):
        search.value[j] = 0.0
        search.rival_mw[j] = np.inf
        search.room_mw[j] = np.inf
        if search.listens[j]:
            search.value[j] = max(_value_at(links, search, j, j), 0.0)
            search.rival_mw[j] = search.air.strongest[j]
            search.room_mw[j] = room_for_interference(links, incoming_at(search.air, j), j)
    best = NOBODY
    best_value = least
    for i in range(num_robots):
        if search.listens[i] and search.has_news[i] and only in (NOBODY, i):
            with_i = _bound(problem, search, i)
            if with_i > best_value:
                with_i = _value_with(links, search, i)
            if with_i > best_value:
                best = i
                best_value = with_i
    return best, best_value


@compiled(makes_arrays=False, forceinline=True, fastmath={"reassoc"})
def _bound(problem: Problem, search: _Search, i: int) -> float:
    """Return no less than what the slot is worth if i transmits, too.

    No packet decodes more probably than in silence, or than before.
    """
    links = problem.links
    total = 0.0
    for j in range(search.listens.shape[0]):
        if links.received_mw[i, j] > search.rival_mw[j]:
            total += max(search.gain[i, j] * problem.lone[i, j], 0.0)
        elif links.interference_mw[i, j] <= search.room_mw[j]:
            total += search.value[j]
    return total * (1.0 + ROUNDING)


@compiled(makes_arrays=False, forceinline=True)
def _value_with(links: Links, search: _Search, also: int) -> float:
    """Return the value of the slot when this robot transmits in addition to those in the air."""
    value = 0.0
    for j in range(search.listens.shape[0]):
        if search.listens[j] and j != also:
            value += _value_at(links, search, also, j)
    return value


@compiled(makes_arrays=False, forceinline=True)
def _value_at(links: Links, search: _Search, also: int, j: int) -> float:
    """Return the value of what j may decode; a robot that is j itself adds nothing to the air."""
    incoming = incoming_with(links, search.air, also, j)
    news = search.gain[incoming.sender, j]
    if incoming.strongest > 0.0 and news != 0.0:
        return news * chance_of_strongest(links, incoming, j)
    return 0.0


@compiled(makes_arrays=False)
def _write_gains(timestamp: Float32[np.ndarray, "N N"], problem: Problem, search: _Search) -> None:
    """Fill in the value of j decoding i, where it can, and which robots have news for anyone."""
    gain = search.gain
    has_news = search.has_news
    for i in range(timestamp.shape[0]):
        has_news[i] = False
        for j in range(timestamp.shape[0]):
            gain[i, j] = 0.0
            if problem.lone[i, j] > 0.0:
                gain[i, j] = value_of_news(timestamp[i], timestamp[j], problem.weight[j])
                if gain[i, j] > 0.0:
                    has_news[i] = True
