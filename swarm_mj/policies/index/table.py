"""The table in which a robot notes what its neighbours know, and what its packet would bring them.

A row is a bound of T of one neighbour from below: what that neighbour has sent, what it must have
decoded from others, and what the robot itself sent it. Rows of neighbours that leave go to others.
Index order: `[b, i, r]` is row r of robot i; it is written from what robot i sent, decoded and
believes only.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int8, Int16

from swarm_mj.policies.index.weights import MOST, Weights
from swarm_mj.protocol.buffers import ABSENT
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.system.compiled import compiled

MAX_ROWS = 32  # a robot's; of more neighbours, those without a row count as those with one
NO_ROW = -1
NOBODY = -1
# A link's chance falls from 1 to 0 around the learned distance by this logistic scale, and so does
# the chance that a neighbour decoded a packet that the robot did [ranges].
REACH_SCALE = 0.067
SHARED_SCALE = 0.02
LEAST_CHANCE = 0.02  # less counts as none
TAKEN_WITHIN = MOST["reach"] + 4.0 * REACH_SCALE  # who is this near is given a row [ranges]
LEFT_BEYOND = 1.2 * TAKEN_WITHIN  # and loses it so far away, lest rows come and go at the edge
KNOWS_ITSELF = np.float32(np.inf)  # in a neighbour's row, of the neighbour itself


class Table(NamedTuple):
    """What every robot notes of its neighbours, in B missions."""

    neighbour: Int16[np.ndarray, "B N R"]  # whose row it is, or NOBODY
    row: Int8[np.ndarray, "B N N"]  # which row a robot has, or NO_ROW
    bound: Float32[np.ndarray, "B N R N"]  # at least this is the neighbour's T [windows]
    announced: Float32[np.ndarray, "B N N"]  # T in the robot's own last packet [windows]
    own: Float32[np.ndarray, "N"]  # room for one robot's next T
    ranges: Float[np.ndarray, "N"]  # room for how far away the others are


class Gain(NamedTuple):
    """What a robot's packet would bring, as it believes, and the neighbourhood that this is of."""

    total: Float[np.ndarray, "B N"]  # rise of T at all in reach, sum over entries [windows]
    largest: Float[np.ndarray, "B N"]  # the part of one neighbour [windows]
    neighbours: Float[np.ndarray, "B N"]  # their number, by the chances of their links
    edge: Float[np.ndarray, "B N"]  # where the robot is among those known: 0 amid, 1 at the edge


def empty_table(num_missions: int, num_robots: int) -> Table:
    """Return the table of robots that know nobody."""
    num_rows = min(MAX_ROWS, num_robots - 1)
    robots = (num_missions, num_robots)
    return Table(
        neighbour=np.full((*robots, num_rows), NOBODY, dtype=np.int16),
        row=np.full((*robots, num_robots), NO_ROW, dtype=np.int8),
        bound=np.zeros((*robots, num_rows, num_robots), dtype=np.float32),
        announced=np.zeros((*robots, num_robots), dtype=np.float32),
        own=np.zeros(num_robots, dtype=np.float32),
        ranges=np.zeros(num_robots),
    )


def empty_gain(num_missions: int, num_robots: int) -> Gain:
    """Return room for the gains of all robots."""
    return Gain(*(np.zeros((num_missions, num_robots)) for _ in Gain._fields))


@compiled(makes_arrays=False)
def chance(ranges: float, half_at: float, scale: float) -> float:
    """Return the chance of a link over a distance: one half at `half_at`, all in ranges."""
    steps = (half_at - ranges) / scale
    if steps > 12.0:
        return 1.0
    if steps < -12.0:
        return 0.0
    return 1.0 / (1.0 + np.exp(-steps))


@compiled(fastmath={"reassoc", "nnan", "nsz"}, makes_arrays=False)
def raise_bound(
    bound: Float32[np.ndarray, "N"], packet: Float32[np.ndarray, "N"], share: np.float32
) -> None:
    """Raise a bound by a share of what it lacks of a packet's T."""
    for k in range(len(bound)):
        bound[k] += share * max(np.float32(0.0), packet[k] - bound[k])


@compiled(makes_arrays=False)
def _take(bound: Float32[np.ndarray, "N"], packet: Float32[np.ndarray, "N"], sender: int) -> None:
    """Note what a sender's own packet says of its T, where the packet has an entry."""
    # Also where that is less: what the robot sent it, and took for decoded, was not.
    for k in range(len(bound)):
        if packet[k] != ABSENT:
            bound[k] = packet[k]
    bound[sender] = KNOWS_ITSELF


@compiled(fastmath={"reassoc", "nnan", "nsz"}, makes_arrays=False)
def lacking(own: Float32[np.ndarray, "N"], bound: Float32[np.ndarray, "N"]) -> float:
    """Return by how much a packet with this T would raise a bound, sum over entries [windows]."""
    total = np.float32(0.0)
    for k in range(len(bound)):
        total += max(np.float32(0.0), own[k] - bound[k])
    return float(total)


@compiled(makes_arrays=False)
def note_and_weigh(
    table: Table,
    gain: Gain,
    timestamp: Float[np.ndarray, "B N N"],
    is_known: Bool[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N 2"],
    now: Float[np.ndarray, "B"],
    heard: Int[np.ndarray, "B N"],
    has_sent: Bool[np.ndarray, "B N"],
    packet: Float32[np.ndarray, "B N N"],
    earlier: Float32[np.ndarray, "B N N"],
    range_m: float,
    weights: Weights,
) -> None:
    """Note a slot that has ended, and say what each robot's packet would bring in the next.

    Args:
        table: What all robots have noted; written.
        gain: What their packets would bring; written.
        timestamp: T of the robots' buffers, [B N N], [windows].
        is_known: Whether i knows anything of j, [B N N].
        position_m: The positions of M, [B N N 2], [m].
        now: t, [B], [windows].
        heard: Whom each robot decoded in the slot, [B N]; itself: nobody.
        has_sent: Who transmitted in it, [B N].
        packet: T in the packet that each robot sent in it, [B N N], [windows].
        earlier: Likewise, in the slot before: packets may arrive a slot late.
        range_m: The radio's range [m].
        weights: The learned numbers of each mission.
    """
    num_missions, num_robots = heard.shape
    own = table.own  # T of a robot's next packet
    ranges = table.ranges  # how far away each robot is believed to be
    for b in range(num_missions):
        for i in range(num_robots):
            total = 0.0
            for k in range(num_robots):
                own[k] = timestamp[b, i, k]
                total += timestamp[b, i, k]
            mean_age = now[b] - total / num_robots
            own[i] = now[b] + SLOT_WINDOWS
            neighbours, num_unknown, edge = _look_around(
                position_m[b, i], is_known[b, i], i, range_m, weights.reach[b, 0], ranges
            )
            _assign_rows(
                table.neighbour[b, i],
                table.row[b, i],
                table.bound[b, i],
                ranges,
                own,
                mean_age,
            )
            sender = heard[b, i]
            is_late = False
            if sender != i:
                # The sender's own entry says when it sent.
                is_late = timestamp[b, i, sender] < packet[b, sender, sender]
            if has_sent[b, i]:
                for k in range(num_robots):
                    table.announced[b, i, k] = max(table.announced[b, i, k], packet[b, i, k])
            counted = 0.0
            brought = 0.0
            largest = 0.0
            for r in range(table.neighbour.shape[2]):
                j = table.neighbour[b, i, r]
                if j == NOBODY:
                    continue
                bound = table.bound[b, i, r]
                link = chance(ranges[j], weights.reach[b, 0], REACH_SCALE)
                if sender != i:
                    said = earlier[b, sender] if is_late else packet[b, sender]
                    if j == sender:
                        _take(bound, said, j)
                    else:
                        apart_m = np.hypot(
                            position_m[b, i, j, 0] - position_m[b, i, sender, 0],
                            position_m[b, i, j, 1] - position_m[b, i, sender, 1],
                        )
                        share = chance(apart_m / range_m, weights.shared[b, 0], SHARED_SCALE)
                        if share > LEAST_CHANCE:
                            raise_bound(bound, said, np.float32(share))
                if link <= LEAST_CHANCE:
                    continue
                if has_sent[b, i]:
                    # The same for all in reach: with a link's chance, those at the edge of it would
                    # never be satisfied.
                    raise_bound(bound, packet[b, i], np.float32(weights.success[b, 0]))
                part = link * lacking(own, bound)
                brought += part
                largest = max(largest, part)
                counted += link
            if counted > 0.0:  # those without a row count as those with one
                brought *= max(1.0, neighbours / counted)
            if num_unknown > 0:
                # Without what was announced, robots that know of one they never heard would
                # transmit for ever.
                unheard = SLOT_WINDOWS + lacking(own, table.announced[b, i])
                brought += weights.stranger[b, 0] * num_unknown / num_robots * unheard
            gain.total[b, i] = brought
            gain.largest[b, i] = largest
            gain.neighbours[b, i] = max(neighbours, counted)
            gain.edge[b, i] = edge


@compiled(makes_arrays=False)
def _look_around(
    position_m: Float[np.ndarray, "N 2"],
    is_known: Bool[np.ndarray, "N"],
    i: int,
    range_m: float,
    reach: float,
    ranges: Float[np.ndarray, "N"],
) -> tuple[float, int, float]:
    """Fill in how far away each robot is believed to be, infinitely if unknown.

    Returns:
        The neighbours' number, by the chances of links; of how many nothing is known; and how far
        the middle of all known robots is, over their mean distance.
    """
    neighbours = 0.0
    num_unknown = 0
    num_known = 0
    sum_x = 0.0
    sum_y = 0.0
    sum_ranges = 0.0
    for j in range(len(ranges)):
        ranges[j] = np.inf
        if j == i:
            continue
        if not is_known[j]:
            num_unknown += 1
            continue
        x = (position_m[j, 0] - position_m[i, 0]) / range_m
        y = (position_m[j, 1] - position_m[i, 1]) / range_m
        ranges[j] = np.sqrt(x * x + y * y)
        num_known += 1
        sum_x += x
        sum_y += y
        sum_ranges += ranges[j]
        if ranges[j] < TAKEN_WITHIN:
            neighbours += chance(ranges[j], reach, REACH_SCALE)
    edge = 0.5
    if sum_ranges > 0.0:
        edge = np.sqrt(sum_x * sum_x + sum_y * sum_y) / sum_ranges
    return neighbours, num_unknown, edge


@compiled(makes_arrays=False)
def _assign_rows(
    neighbour: Int16[np.ndarray, "R"],
    row: Int8[np.ndarray, "N"],
    bound: Float32[np.ndarray, "R N"],
    ranges: Float[np.ndarray, "N"],
    own: Float32[np.ndarray, "N"],
    mean_age: float,
) -> None:
    """Take rows from those who left, and give free ones to the nearest who have none."""
    num_robots = len(ranges)
    for r in range(len(neighbour)):
        j = neighbour[r]
        if j != NOBODY and ranges[j] > LEFT_BEYOND:
            row[j] = NO_ROW
            neighbour[r] = NOBODY
    num_waiting = 0
    for j in range(num_robots):
        if ranges[j] < TAKEN_WITHIN and row[j] == NO_ROW:
            num_waiting += 1
    for r in range(len(neighbour)):
        if num_waiting == 0:
            return
        if neighbour[r] != NOBODY:
            continue
        nearest = NOBODY
        for j in range(num_robots):
            is_free = ranges[j] < TAKEN_WITHIN and row[j] == NO_ROW
            if is_free and (nearest == NOBODY or ranges[j] < ranges[nearest]):
                nearest = j
        neighbour[r] = nearest
        row[nearest] = r
        num_waiting -= 1
        # Of a newcomer nothing is noted. That it knows nothing would be a bound, but late in a
        # mission the robot would then transmit as if the team had just begun: it is taken to be
        # behind the robot by the mean age.
        for k in range(num_robots):
            bound[r, k] = max(np.float32(0.0), own[k] - np.float32(mean_age))
        bound[r, nearest] = KNOWS_ITSELF
