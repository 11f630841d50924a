"""The table in which a robot notes what its neighbours know, and what its packet would bring them.

A row is T of one neighbour, as the robot estimates it: what that neighbour has sent, what it is
taken to have decoded from others, and a share of what the robot itself sent it. Rows of neighbours
that leave go to others. Index order: `[b, i, r]` is row r of robot i; it is written from what robot
i sent, decoded and believes only.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int8, Int16

from swarm_mj.mission.geometry import HEIGHT, PLANE
from swarm_mj.policies.index.weights import MOST, Weights
from swarm_mj.protocol.buffers import ABSENT
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, rise, total_rise
from swarm_mj.system.compiled import compiled

MAX_ROWS = 32  # a robot's; of more neighbours, those without a row count as those with one
NO_ROW = -1
NO_NEIGHBOUR = -1
MIDDLE = 0.5  # of `Around.edge`, of a robot that knows nobody
# A link's chance falls from 1 to 0 around the learned distance by this logistic scale, and so does
# the chance that a neighbour decoded a packet that the robot did [ranges].
REACH_SCALE = 0.067
SHARED_SCALE = 0.02
LEAST_CHANCE = 0.02  # less counts as none
TAKEN_WITHIN = MOST["reach"] + 4.0 * REACH_SCALE  # who is this near is given a row [ranges]
LEFT_BEYOND = 1.2 * TAKEN_WITHIN  # and loses it so far away, lest rows come and go at the edge
KNOWS_ITSELF = np.float32(np.inf)  # in a neighbour's row, of the neighbour itself


class Table(NamedTuple):
    """The notes of every robot on its neighbours, in B missions."""

    neighbour: Int16[np.ndarray, "B N R"]  # whose row it is, or NO_NEIGHBOUR
    row: Int8[np.ndarray, "B N N"]  # which row a robot has, or NO_ROW
    bound: Float32[np.ndarray, "B N R N"]  # the neighbour's T, as estimated [windows]
    announced: Float32[np.ndarray, "B N N"]  # greatest T in the robot's own packets [windows]
    own: Float32[np.ndarray, "N"]  # room for one robot's next T
    ranges: Float[np.ndarray, "N"]  # room for how far away the others are


class Around(NamedTuple):
    """A robot's neighbourhood, as it believes."""

    neighbours: float  # their number, by the chances of their links
    num_unknown: int  # robots of whom it knows nothing
    edge: float  # how far the middle of those it knows is, over their mean distance


class Gain(NamedTuple):
    """The news in each robot's next packet, as it believes, and the neighbourhood it is for."""

    total: Float[np.ndarray, "B N"]  # rise of T at all in reach, sum over entries [windows]
    largest: Float[np.ndarray, "B N"]  # the part of one neighbour [windows]
    neighbours: Float[np.ndarray, "B N"]  # their number, by the chances of their links
    edge: Float[np.ndarray, "B N"]  # where the robot is among those known: 0 amid, 1 at the edge


def empty_table(num_missions: int, num_robots: int) -> Table:
    """Return the table of robots that know nobody."""
    num_rows = min(MAX_ROWS, num_robots - 1)
    robots = (num_missions, num_robots)
    return Table(
        neighbour=np.full((*robots, num_rows), NO_NEIGHBOUR, dtype=np.int16),
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
def chance_within(ranges: float, half_at: float, scale: float) -> float:
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
        bound[k] += share * rise(packet[k], bound[k])


@compiled(makes_arrays=False)
def _copy_entries(
    packet: Float32[np.ndarray, "N"], sender: int, bound: Float32[np.ndarray, "N"]
) -> None:
    """Take T of its sender's packet for what the sender knows, where the packet has an entry."""
    # Also where that is less: what the robot sent it, and took for decoded, it has not decoded.
    for k in range(len(bound)):
        if packet[k] != ABSENT:
            bound[k] = packet[k]
    bound[sender] = KNOWS_ITSELF


@compiled(makes_arrays=False)
def note_and_weigh(
    table: Table,
    gain: Gain,
    timestamp: Float[np.ndarray, "B N N"],
    is_known: Bool[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N D"],
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
        position_m: The positions of M, [B N N D], [m].
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
            own[i] = now[b] + SLOT_WINDOWS
            around = _look_around(
                position_m[b, i], is_known[b, i], i, range_m, weights.reach[b, 0], ranges
            )
            _leave_rows(table.neighbour[b, i], table.row[b, i], ranges)
            mean_age = now[b] - total / num_robots
            _take_rows(
                table.neighbour[b, i], table.row[b, i], table.bound[b, i], ranges, own, mean_age
            )
            sender = heard[b, i]
            if sender != i:
                # The sender's own entry says when it sent.
                is_late = timestamp[b, i, sender] < packet[b, sender, sender]
                said = earlier[b, sender] if is_late else packet[b, sender]
                _note_decoded(
                    table, b, i, sender, said, position_m[b, i], range_m, weights.shared[b, 0]
                )
            if has_sent[b, i]:
                _note_sent(table, b, i, packet[b, i], ranges, weights)
            _weigh(table, gain, b, i, around, weights)


@compiled(makes_arrays=False)
def _note_decoded(
    table: Table,
    b: int,
    i: int,
    sender: int,
    said: Float32[np.ndarray, "N"],
    position_m: Float[np.ndarray, "N D"],
    range_m: float,
    shared: float,
) -> None:
    """Note T of a packet that a robot decoded, and that its neighbours near the sender did, too."""
    for r in range(table.neighbour.shape[2]):
        j = table.neighbour[b, i, r]
        if j == NO_NEIGHBOUR:
            continue
        if j == sender:
            _copy_entries(said, j, table.bound[b, i, r])
            continue
        apart_m = np.hypot(
            position_m[j, 0] - position_m[sender, 0], position_m[j, 1] - position_m[sender, 1]
        )
        if position_m.shape[1] > PLANE:
            apart_m = np.hypot(apart_m, position_m[j, HEIGHT] - position_m[sender, HEIGHT])
        share = chance_within(apart_m / range_m, shared, SHARED_SCALE)
        if share > LEAST_CHANCE:
            raise_bound(table.bound[b, i, r], said, np.float32(share))


@compiled(makes_arrays=False)
def _note_sent(
    table: Table,
    b: int,
    i: int,
    said: Float32[np.ndarray, "N"],
    ranges: Float[np.ndarray, "N"],
    weights: Weights,
) -> None:
    """Note T of a packet that a robot sent, and that its neighbours may have decoded."""
    for k in range(len(said)):
        table.announced[b, i, k] = max(table.announced[b, i, k], said[k])
    for r in range(table.neighbour.shape[2]):
        j = table.neighbour[b, i, r]
        if j == NO_NEIGHBOUR:
            continue
        if chance_within(float(ranges[j]), weights.reach[b, 0], REACH_SCALE) > LEAST_CHANCE:
            # The same for all in reach: with a link's chance, robots would transmit for ever to
            # those at the edge of it.
            raise_bound(table.bound[b, i, r], said, np.float32(weights.success[b, 0]))


@compiled(makes_arrays=False)
def _weigh(table: Table, gain: Gain, b: int, i: int, around: Around, weights: Weights) -> None:
    """Say what a robot's next packet, whose T is in `Table.own`, would bring."""
    num_robots = len(table.own)
    counted = 0.0
    brought = 0.0
    largest = 0.0
    for r in range(table.neighbour.shape[2]):
        j = table.neighbour[b, i, r]
        if j == NO_NEIGHBOUR:
            continue
        link = chance_within(float(table.ranges[j]), weights.reach[b, 0], REACH_SCALE)
        if link > LEAST_CHANCE:
            part = link * total_rise(table.own, table.bound[b, i, r])
            brought += part
            largest = max(largest, part)
            counted += link
    if counted > 0.0:  # those without a row count as those with one
        brought *= max(1.0, around.neighbours / counted)
    if around.num_unknown > 0:
        # Without what was announced, robots that know of one they never heard of would transmit
        # for ever.
        unheard = SLOT_WINDOWS + total_rise(table.own, table.announced[b, i])
        brought += weights.stranger[b, 0] * around.num_unknown / num_robots * unheard
    gain.total[b, i] = brought
    gain.largest[b, i] = largest
    gain.neighbours[b, i] = max(around.neighbours, counted)
    gain.edge[b, i] = around.edge


@compiled(makes_arrays=False)
def _look_around(
    position_m: Float[np.ndarray, "N D"],
    is_known: Bool[np.ndarray, "N"],
    i: int,
    range_m: float,
    reach: float,
    ranges: Float[np.ndarray, "N"],
) -> Around:
    """Fill in how far away each robot is believed to be, and return what is around one of them."""
    neighbours = 0.0
    num_unknown = 0
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
        sum_x += x
        sum_y += y
        sum_ranges += ranges[j]
        if position_m.shape[1] > PLANE:  # an edge is one in the plane, but packets rise
            ranges[j] = np.hypot(
                ranges[j], (position_m[j, HEIGHT] - position_m[i, HEIGHT]) / range_m
            )
        if ranges[j] < TAKEN_WITHIN:
            neighbours += chance_within(ranges[j], reach, REACH_SCALE)
    edge = MIDDLE
    if sum_ranges > 0.0:
        edge = np.sqrt(sum_x * sum_x + sum_y * sum_y) / sum_ranges
    return Around(neighbours=neighbours, num_unknown=num_unknown, edge=edge)


@compiled(makes_arrays=False)
def _leave_rows(
    neighbour: Int16[np.ndarray, "R"], row: Int8[np.ndarray, "N"], ranges: Float[np.ndarray, "N"]
) -> None:
    """Take their rows from those who are too far away by now."""
    for r in range(len(neighbour)):
        j = neighbour[r]
        if j != NO_NEIGHBOUR and ranges[j] > LEFT_BEYOND:
            row[j] = NO_ROW
            neighbour[r] = NO_NEIGHBOUR


@compiled(makes_arrays=False)
def _take_rows(
    neighbour: Int16[np.ndarray, "R"],
    row: Int8[np.ndarray, "N"],
    bound: Float32[np.ndarray, "R N"],
    ranges: Float[np.ndarray, "N"],
    own: Float32[np.ndarray, "N"],
    mean_age: float,
) -> None:
    """Give free rows to those near who have none, the nearest first."""
    for r in range(len(neighbour)):
        if neighbour[r] != NO_NEIGHBOUR:
            continue
        j = _nearest_without(row, ranges)
        if j == NO_NEIGHBOUR:
            return
        neighbour[r] = j
        row[j] = r
        # Of a newcomer nothing is noted. That it knows nothing would be a bound, but late in a
        # mission the robot would then transmit as if the team had just begun: it is taken to be
        # behind the robot by the mean age.
        for k in range(len(own)):
            bound[r, k] = max(np.float32(0.0), own[k] - np.float32(mean_age))
        bound[r, j] = KNOWS_ITSELF


@compiled(makes_arrays=False)
def _nearest_without(row: Int8[np.ndarray, "N"], ranges: Float[np.ndarray, "N"]) -> int:
    """Return the nearest robot that may have a row and has none, or NO_NEIGHBOUR."""
    nearest = NO_NEIGHBOUR
    for j in range(len(ranges)):
        may_have = row[j] == NO_ROW and ranges[j] < TAKEN_WITHIN
        if may_have and (nearest == NO_NEIGHBOUR or ranges[j] < ranges[nearest]):
            nearest = j
    return nearest
