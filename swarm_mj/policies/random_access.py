"""Random access: robots that draw in each slot whether they transmit.

Random flooding (IV-C), slotted ALOHA and innovation gossip; they differ in what the chance is of.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from numbers import Real

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.mission.geometry import squared_distance
from swarm_mj.policies.about import FEW_BYTES, FromPaper, Information, Listed, Look, Textbook
from swarm_mj.policies.policy import BroadcastPolicy, Parameters, Policy
from swarm_mj.protocol.window import LocalViews
from swarm_mj.protocol.window_protocols import DoubleBroadcast, WindowProtocol
from swarm_mj.system.compiled import compiled


class RandomTransmission(Policy, ABC):
    """The common base of policies whose robots draw whether they transmit.

    `make_policy` gives each of them the probability that was tuned for it, unless another is asked
    for.
    """

    @classmethod
    @abstractmethod
    def with_probability(cls, mission: Mission, probability: float) -> Policy:
        """Return the policy for a mission, with this probability."""

    def __init__(self, probability: float) -> None:
        """Take the probability, whose meaning is each policy's own.

        Raises ValueError if it is no number from 0 to 1.
        """
        if not isinstance(probability, Real) or not 0.0 <= float(probability) <= 1.0:
            raise ValueError(f"transmission probability must be from 0 to 1, not {probability!r}")
        self._probability = float(probability)  # NumPy's would not go into JSON

    @property
    def parameters(self) -> Parameters:
        """The probability."""
        return {"probability": self._probability}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own stream of numbers; arguments as in `Policy.start`."""
        self._stream = Stream(rngs, uniform, (num_robots,))


class RandomFlooding(RandomTransmission, BroadcastPolicy):
    """Every robot broadcasts with probability p (IV-C).

    It does so in both slots of a window, unanswered (Tseng et al., The broadcast storm problem,
    2002). As in the authors' code a robot that transmits draws an addressee from the whole team,
    and is silent if it draws itself: so it transmits with p (N - 1) / N. Packets name the addressee
    only under their half-duplex rule, by which an addressed robot hears while it sends.
    """

    about = Listed(
        name="random-flooding",
        origin=FromPaper(section="IV-C"),
        rank=10,
        uses="only the size of the team: it transmits with probability p (N - 1) / N",
        beyond=(),
        payload=None,
        look=Look(label="random-flooding", colour="#e69f00", marker="o"),
        memory=FEW_BYTES,
    )

    @classmethod
    def with_probability(cls, mission: Mission, probability: float) -> "RandomFlooding":
        """Return the policy for a mission, by whose preset packets name an addressee or not."""
        return cls(probability, names_addressee=mission.recipient_hears_while_sending)

    def __init__(self, probability: float, *, names_addressee: bool = False) -> None:
        """Take the probability of a draw in each slot, and whether packets name an addressee."""
        super().__init__(probability)
        self._names_addressee = names_addressee

    def window(self, mission: Mission) -> WindowProtocol:
        """Return two broadcasts; in the authors' code robots also move twice."""
        return DoubleBroadcast(
            silence_is_attempt=mission.silence_is_attempt,
            moves_each_slot=mission.moves_each_transmission,
        )

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own stream of pairs; arguments as in `Policy.start`."""
        self._stream = Stream(rngs, uniform, (2, num_robots))

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot that draws a transmission, to a teammate."""
        return self._drawn(views) != views.silence

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return a broadcast's recipients, or the addressees, where packets name them."""
        return self._drawn(views) if self._names_addressee else super().recipients(views)

    def _drawn(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return an addressee for each robot that draws a transmission, else the robot itself."""
        chance, choice = self._stream.next().swapaxes(0, 1)  # of [B 2 N]
        anyone = (choice * views.num_robots).astype(np.int64)
        return np.where(chance < self._probability, anyone, views.silence)


class Aloha(RandomTransmission, BroadcastPolicy):
    """The more neighbours a robot has, the less it sends.

    In slotted ALOHA (Abramson 1970; Roberts 1975) what counts is the load that all n stations offer
    together, so each of them sends less the more there are. Here a neighbourhood's robots are its
    stations, and `probability` is that any of them broadcasts in a slot: each does so with
    1 - (1 - p)^(1/n).
    """

    about = Listed(
        name="aloha",
        origin=Textbook(source="Abramson 1970; Roberts 1975"),
        rank=40,
        uses="the size of the team, and how many robots in its buffer are in range",
        beyond=(
            Information.TEAM_SIZE,
            Information.OBSERVED_POSITIONS,
            Information.RADIO_CONSTANTS,
        ),
        payload=None,
        look=Look(label="aloha", colour="#999933", marker="v"),
        memory=FEW_BYTES,
    )

    @classmethod
    def with_probability(cls, mission: Mission, probability: float) -> "Aloha":
        """Return the policy for a mission's range."""
        return cls(probability, range_m=mission.range_m)

    def __init__(self, probability: float, *, range_m: float) -> None:
        """Take the probability and the distance at which a lone transmission just decodes [m].

        Raises ValueError if the probability is no number from 0 to 1.
        """
        super().__init__(probability)
        self._range_m = range_m

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot that draws a broadcast."""
        buffers = views.buffers
        everyone_silent = 1.0 - self._probability  # the probability of it
        contenders = num_contenders(buffers.is_known, buffers.position_m, self._range_m)
        return self._stream.next() < 1.0 - everyone_silent ** (1.0 / contenders)


@compiled()
def num_contenders(
    is_known: Bool[np.ndarray, "B N N"], believed_m: Float[np.ndarray, "B N N D"], range_m: float
) -> Float[np.ndarray, "B N"]:
    """Return how many robots contend for each robot's neighbourhood, as far as it can tell.

    The team's size times the share of the known robots, itself included, believed in range: the
    whole team, then, until it has heard of anyone.
    """
    num_missions, num_robots = is_known.shape[:2]
    contenders = np.empty((num_missions, num_robots))
    for b in range(num_missions):
        for i in range(num_robots):
            place_m = believed_m[b, i]
            num_known = 1
            num_near = 1
            for j in range(num_robots):
                if is_known[b, i, j] and j != i:
                    num_known += 1
                    if squared_distance(place_m, j, i) <= range_m * range_m:
                        num_near += 1
            contenders[b, i] = num_robots * num_near / num_known
    return contenders


class InnovationGossip(RandomTransmission, BroadcastPolicy):
    """The more news a robot has, the likelier it sends it.

    Rumour mongering (Demers et al. 1987) by radio. News is how much a robot's knowledge has become
    fresher since its own last broadcast: the rise of T^{i,j}, its own included, averaged over the
    team [windows]. A robot broadcasts with p times that, at most with certainty: p is per window of
    news. So robots that hear much pass it on soon, and one that hears nothing still reports its
    position now and then. Two unanswered broadcasts a window lead to a lower age than one packet
    that a neighbour answers.
    """

    about = Listed(
        name="gossip",
        origin=Textbook(source="Demers et al. 1987"),
        rank=70,
        uses=("how much its T has risen since its last transmission, averaged over the team"),
        beyond=(Information.TEAM_SIZE,),
        payload=None,
        look=Look(label="gossip", colour="#882255", marker="P", marker_size=5.0),
        memory=FEW_BYTES,
    )

    @classmethod
    def with_probability(cls, mission: Mission, probability: float) -> "InnovationGossip":  # noqa: ARG003
        """Return the policy, which is the same for every mission."""
        return cls(probability)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own numbers, and everything to tell; as `Policy.start`."""
        super().start(num_robots, rngs)
        self._sent = np.zeros((len(rngs), num_robots))  # mean T at the last broadcast [windows]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot that draws a broadcast, and remember what it sends."""
        known = np.mean(views.buffers.timestamp, axis=2)  # T never falls, so means tell its rise
        is_sending = self._stream.next() < self._probability * (known - self._sent)
        self._sent = np.where(is_sending, known, self._sent)
        return is_sending
