"""The greedy oracle: a scheduler that knows all buffers and positions at every moment.

A team could not fly it; it shows how low the age of information can go. The pair of sender and
recipient is added that most raises the gain of the whole window, interference and responses
included, until none does. The gain is the sum over receivers i and subjects k of the rise of
T^{i,k}: the fall of the age of information times N².

Over uncertain links a packet decodes with a probability, and timestamps are expected ones. Index
order: `i` sends, `j` receives. Times are in slots, float32, which keeps them exact for 8 million
windows.
"""

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.about import Bound, Information, Listed, Look, PairMemory
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW, merge_expected, observe_own, total_rise
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.links import Links, air_of, among, listen
from swarm_mj.radio.mission_radio import TrueLinks, radio_of
from swarm_mj.radio.reception import NOBODY
from swarm_mj.system.compiled import compiled


class GreedyOracle(CentralisedPolicy):
    """Adds pairs while that lowers the age; not optimal.

    Centralised: it sees all buffers and all true positions. It addresses no robot that sends, even
    where the authors' code would let that robot hear.
    """

    about = Listed(
        name="greedy-oracle",
        origin=Bound(),
        rank=130,
        uses=(
            "T in all buffers, all true positions and the true channel except its fades, at every "
            "moment, and which robots have failed"
        ),
        beyond=(Information.TRUE_POSITIONS, Information.ALL_BUFFERS, Information.TRUE_CHANNEL),
        payload=None,
        look=Look(
            label="greedy-oracle", colour="#000000", marker=".", marker_size=5.0, line_width=0.8
        ),
        memory=PairMemory(bytes_per_pair=60.0),
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "GreedyOracle":
        """Return the policy for a mission's radio."""
        return cls(mission)

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio, in free space unless informed otherwise."""
        self._truth = TrueLinks(radio=radio_of(mission))

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the window's schedule; robots move before they talk, which it does not foresee."""
        timestamp = (SLOTS_PER_WINDOW * views.buffers.timestamp).astype(np.float32)
        now = (SLOTS_PER_WINDOW * views.now).tolist()
        recipient = []
        for b, position_m in enumerate(states.position_m):
            links = self._truth.links(position_m, b)
            if states.is_active is not None:
                links = among(links, states.is_active[b])
            recipient.append(greedy_window(timestamp[b], now[b], links))
        return np.stack(recipient)


@compiled()
def greedy_window(
    timestamp: Float32[np.ndarray, "N N"], now: float, links: Links
) -> Int[np.ndarray, "N"]:
    """Return the recipient of every robot, itself for silence.

    Args:
        timestamp: T before the window [slots].
        now: t before the window [slots].
        links: The true links before their fades.
    """
    num_robots = timestamp.shape[0]
    sent = timestamp.copy()
    observe_own(sent, now + 1.0)
    gains = packet_gains(sent, links)
    recipient = np.arange(num_robots)
    gain = 0.0
    while True:
        # A new pair changes the interference at all receivers, so every candidate is valued anew.
        value = window_gains(sent, gains, now, links, recipient)
        pair = np.argmax(value)
        i = pair // num_robots
        r = pair % num_robots
        if value[i, r] <= gain:
            return recipient
        gain = value[i, r]
        recipient[i] = r


@compiled()
def packet_gains(sent: Float32[np.ndarray, "N N"], links: Links) -> Float[np.ndarray, "N N"]:
    """Return what j gains from i's packet [slots]; 0 where it is never received."""
    num_robots = sent.shape[0]
    gains = np.zeros((num_robots, num_robots))
    for i in range(num_robots):
        for j in range(num_robots):
            if links.received_mw[i, j] > 0.0:
                gains[i, j] = total_rise(sent[i], sent[j])
    return gains


@compiled()
def window_gains(
    sent: Float32[np.ndarray, "N N"],
    gains: Float[np.ndarray, "N N"],
    now: float,
    links: Links,
    recipient: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "N N"]:
    """Return the gain of the whole window when i also addresses r; -inf where it cannot.

    Neither robot of a new pair may send or be addressed already: a robot that sends hears nothing.
    Of all r that do not decode i, hence do not answer, one stands for all: a broadcast. Packets of
    the first slot hold `sent`, and are worth `packet_gains`.
    """
    num_robots = sent.shape[0]
    is_silent = recipient == np.arange(num_robots)
    is_free = is_silent.copy()
    for i in range(num_robots):
        if not is_silent[i]:
            is_free[recipient[i]] = False
    air = air_of(links, ~is_silent)
    value = np.full((num_robots, num_robots), -np.inf)
    after = np.empty_like(sent)
    heard = np.arange(num_robots)
    probability = np.zeros(num_robots)
    for i in range(num_robots):
        if is_free[i]:
            listen(
                links=links,
                air=air,
                also=i,
                listens=is_silent,
                heard=heard,
                probability=probability,
            )
            gain = 0.0
            for j in range(num_robots):
                gain += probability[j] * gains[heard[j], j]
            merge_expected(sent, heard, probability, after)
            observe_own(after, now + SLOTS_PER_WINDOW)
            _add_responses(
                links=links,
                i=i,
                recipient=recipient,
                is_free=is_free,
                heard=heard,
                probability=probability,
                after=after,
                gain=gain,
                value=value[i],
            )
    return value


@compiled()
def _add_responses(
    links: Links,
    i: int,
    recipient: Int[np.ndarray, "N"],
    is_free: Bool[np.ndarray, "N"],
    heard: Int[np.ndarray, "N"],
    probability: Float[np.ndarray, "N"],
    after: Float32[np.ndarray, "N N"],
    gain: float,
    value: Float[np.ndarray, "N"],
) -> None:
    """Fill `value[r]`: the gain of the first slot and of the responses if r is i's recipient.

    Args:
        links: The true links before their fades.
        i: The new sender.
        recipient: Of each robot, but for i; itself for silence.
        is_free: Whether each may become i's recipient.
        heard: Whom each may decode in the first slot.
        probability: That it does.
        after: T after the first slot, when responses are sent [slots].
        gain: Of the first slot, summed over T [slots].
        value: Of each r; entries of robots that cannot be i's recipient remain [slots].
    """
    num_robots = recipient.shape[0]
    answers = np.zeros(num_robots, dtype=np.bool_)  # who may decode a packet addressed to it
    for j in range(num_robots):
        answers[j] = heard[j] != j and recipient[heard[j]] == j
    air = air_of(links, answers)
    listens = ~answers
    answerer = np.arange(num_robots)
    answer_probability = np.zeros(num_robots)
    has_broadcast = False
    for r in range(num_robots):
        decodes = heard[r] == i
        if r != i and is_free[r] and (decodes or not has_broadcast):
            has_broadcast |= not decodes
            listen(
                links=links,
                air=air,
                also=r if decodes else NOBODY,
                listens=listens,
                heard=answerer,
                probability=answer_probability,
            )
            total = gain
            for j in range(num_robots):
                if answer_probability[j] > 0.0:
                    # A response is only sent if the request was decoded.
                    is_sent = probability[answerer[j]]
                    risen = total_rise(after[answerer[j]], after[j])
                    total += answer_probability[j] * is_sent * risen
            value[r] = total
