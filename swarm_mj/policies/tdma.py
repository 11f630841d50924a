"""Time-division multiple access: one robot broadcasts after the other, or several far apart.

For the second see Nelson and Kleinrock 1985; by interference, Grönkvist and Hansson 2001. Robots
that do not know everyone yet share slots by node activation (NAMA: Bao, Garcia-Luna-Aceves 2001).
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.mission.geometry import squared_distance
from swarm_mj.policies.about import FEW_BYTES, Information, Listed, Look, Textbook
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, slot_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import Belief
from swarm_mj.radio.power_law import PowerLaw, no_powers
from swarm_mj.radio.spatial_reuse import keep_joined
from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import from_db

CONTENTION_RANGES = 1.4  # robots nearer than this contend; tuned for 80 to 1000 walkers
# In sparser areas no random team is connected. Robots that are all the same stand closer together
# than the area says, and would contend as if alone, in every slot, for ever.
MIN_EXPECTED = 3.0  # robots in reach, oneself too, below which robots take turns
MIN_CROWDS = 8.0  # of robots in reach, below which teams do better by turns
# Where beliefs are wrong (walls, fading, noise), those who join may drown out the owner each time.
# A robot without news of it for this many rounds a hop leaves it alone until it has some.
PATIENCE_ROUNDS = 2.0


class Tdma(BroadcastPolicy):
    """Robots take turns, in a fixed random order.

    Time-division multiple access (Miao, Zander, Sung, Slimane: Fundamentals of Mobile Data
    Networks, 2016). Nobody interferes, so every robot in range decodes. The order is drawn for each
    mission and, like the identities, granted to all of its robots beforehand (II-C).
    """

    about = Listed(
        name="tdma",
        origin=Textbook(source="Miao, Zander, Sung and Slimane 2016"),
        rank=80,
        uses=(
            "its identity, the size of the team, a common random order and the clock: one robot "
            "transmits per slot"
        ),
        beyond=(Information.COMMON_ORDER, Information.CLOCK, Information.TEAM_SIZE),
        payload=None,
        look=Look(label="tdma", colour="#0072b2", marker="D", marker_size=4.0),
        memory=FEW_BYTES,
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "Tdma":  # noqa: ARG003
        """Return the policy, which is the same for every mission."""
        return cls()

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every mission's order; arguments as in `Policy.start`."""
        self._order = draw_order(num_robots, rngs)

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return the one robot whose slot it is."""
        return self.owns_slot(views)

    def owns_slot(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return the one robot whose slot it is, whatever anyone believes."""
        place = slot_of(views.now) % views.num_robots
        owner = self._order[np.arange(len(place)), place]
        return views.silence == owner[:, None]


class SpatialTdma(Tdma):
    """TDMA where robots that are far apart share a slot.

    Who joins the owner of the turn is the rule of `radio.spatial_reuse`: each robot predicts from
    its own buffer, alone, which packets its teammates would decode, and robots that believe the
    same decide the same. Until a robot has heard of everyone it transmits in its own turn only; and
    so it does in the turns of a robot of which it has had no news for long.
    Large teams' rounds are too long for that: there such robots also send where they win by node
    activation. There is one difference: common random numbers are weighted by a robot's news.
    """

    about = Listed(
        name="spatial-tdma",
        origin=Textbook(source="Nelson and Kleinrock 1985; Grönkvist and Hansson 2001"),
        rank=90,
        uses=(
            "as tdma, and the positions in its buffer and its prior knowledge of the radio: robots "
            "far apart share a slot; in large teams also T, the senders that it decodes, the area "
            "and common random numbers: robots with much news transmit"
        ),
        beyond=(
            Information.COMMON_ORDER,
            Information.CLOCK,
            Information.TEAM_SIZE,
            Information.OBSERVED_POSITIONS,
            Information.RADIO_CONSTANTS,
            Information.COMMON_RANDOM_NUMBERS,  # in large teams alone
            Information.DECODED_PACKETS,  # likewise
            Information.AREA,
            Information.PRIOR_KNOWLEDGE,
        ),
        payload=None,
        look=Look(label="spatial-tdma", colour="#332288", marker="h", marker_size=5.5),
        memory=FEW_BYTES,
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "SpatialTdma":
        """Return the policy for a mission's radio."""
        return cls(mission)

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio, in free space unless informed otherwise."""
        self._num_robots = mission.num_robots
        self._num_axes = mission.num_axes
        self._range_m = mission.range_m
        self._threshold = from_db(mission.sinr_threshold_db)
        self._law: PowerLaw | None = None  # of mean powers [noise]; None: that of free space
        # Of the area, in which robots contend with one. Where it is small, many robots far apart
        # could send at once, and turns take too long.
        share = math.pi * (CONTENTION_RANGES * self._range_m) ** 2 / mission.side_m**2
        self._num_expected = mission.num_robots * share  # robots in reach, oneself too
        self._contends = share <= 1.0 / MIN_CROWDS and self._num_expected >= MIN_EXPECTED

    def inform(self, belief: Belief) -> None:
        """Take the powers that robots believe in."""
        super().inform(belief)
        self._law = None if belief.law is None else belief.law_over_noise(self._num_robots)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every mission's order, and forget powers; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        self._powers = (
            None if self._law is None else no_powers(self._law, len(rngs), self._num_axes)
        )
        self._draws = Stream(rngs, uniform, (2, num_robots))  # common to all robots
        if self._contends:
            # Both of k as i knows, [b, i, k]: as `winners` has them.
            self._news = np.zeros((len(rngs), num_robots, num_robots), dtype=np.float32)
            self._noted_at = np.zeros_like(self._news)

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot whose turn it is or that may join."""
        buffers = views.buffers
        is_oneself = np.eye(views.num_robots, dtype=np.bool_)
        knows_all = np.all(buffers.is_known | is_oneself, axis=2)
        is_sending = knows_all.copy()
        turn = slot_of(views.now)
        leave_lost_owners(
            timestamp=buffers.timestamp,
            believed_m=buffers.position_m,
            order=self._order,
            turn=turn,
            now=views.now,
            range_m=self._range_m,
            is_sending=is_sending,
        )
        keep_joined(
            believed_m=buffers.position_m,
            order=self._order,
            turn=turn,
            range_m=self._range_m,
            threshold=self._threshold,
            is_sending=is_sending,
            powers=self._powers,
        )
        if self._contends:
            heard = views.last_heard
            priority_draw, rarity_draw = self._draws.next().swapaxes(0, 1)
            wins = winners(
                timestamp=buffers.timestamp,
                believed_m=buffers.position_m,
                heard=heard,
                priority_draw=priority_draw,
                rarity_draw=rarity_draw,
                range_m=self._range_m,
                num_expected=self._num_expected,
                noted_at=self._noted_at,
                news=self._news,
            )
            is_sending |= wins & ~knows_all
            # A robot that sends tells all that it knows, so it has no news any longer.
            self._news[is_sending[:, :, None] & is_oneself] = 0.0
        return is_sending


def draw_order(num_robots: int, rngs: Sequence[np.random.Generator]) -> Int[np.ndarray, "B N"]:
    """Return a random order for each mission: the robot at each place of it."""
    return np.stack([rng.permutation(num_robots) for rng in rngs])


@compiled()
def leave_lost_owners(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N D"],
    order: Int[np.ndarray, "B N"],
    turn: Int[np.ndarray, "B"],
    now: Float[np.ndarray, "B"],
    range_m: float,
    is_sending: Bool[np.ndarray, "B N"],
) -> None:
    """Take robots off the senders that have had no news of the turn's owner for long.

    Args:
        timestamp: T as each robot knows it [windows].
        believed_m: Where each robot believes all to be [m].
        order: The robot at each place; `turn` (mod N) is the owner's.
        turn: The slot that begins, counted from 0.
        now: When it begins [windows].
        range_m: How far a hop reaches [m].
        is_sending: Those who may join; written in place.
    """
    num_missions, num_robots = order.shape
    round_windows = num_robots * SLOT_WINDOWS
    for b in range(num_missions):
        owner = order[b, turn[b] % num_robots]
        for i in range(num_robots):
            apart_m = math.sqrt(squared_distance(believed_m[b, i], i, owner))
            num_hops = 1.0 + apart_m / range_m
            if now[b] - timestamp[b, i, owner] > PATIENCE_ROUNDS * num_hops * round_windows:
                is_sending[b, i] = False


@compiled()
def winners(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N D"],
    heard: Int[np.ndarray, "B N"],
    priority_draw: Float[np.ndarray, "B N"],
    rarity_draw: Float[np.ndarray, "B N"],
    range_m: float,
    num_expected: float,
    noted_at: Float32[np.ndarray, "B N N"],
    news: Float32[np.ndarray, "B N N"],
) -> Bool[np.ndarray, "B N"]:
    """Return who wins by its own beliefs, and bring `news` from T as noted to the present T.

    The highest ln(u) / w wins (Efraimidis, Spirakis 2006), the rarer the fewer of those expected in
    reach are known.

    Args:
        timestamp: T as each robot knows it [windows].
        believed_m: Where each robot believes all to be [m].
        heard: Whom each decoded in the last slot; itself: nobody.
        priority_draw: u of each robot, from 0 to 1; common to all.
        rarity_draw: Of each robot, likewise; it decides how rarely the robot wins.
        range_m: The distance at which a lone packet just decodes [m].
        num_expected: How many robots are expected in reach of each, itself too.
        noted_at: T when news was last brought up to date; it becomes the present T [windows].
        news: [b, i, k]: the rise of k's T, summed, since its last packet, as i estimates it
            [windows]: k learned what i did if i believes it in range of the sender that i decoded.
    """
    wins = np.zeros(heard.shape, dtype=np.bool_)
    priority = np.empty(heard.shape[1])
    for b in range(heard.shape[0]):
        for i in range(heard.shape[1]):
            rise = timestamp[b, i] - noted_at[b, i]
            learned = rise.sum() - rise[i]  # what i learned of others
            sender = heard[b, i]
            num_near = 1  # robots in reach that i knows, itself too
            best = -np.inf  # the highest priority of the others in reach
            for k in range(heard.shape[1]):
                age = timestamp[b, i, i] - timestamp[b, i, k]
                has_sent = k != i and rise[k] > 0.0
                # What k knows of itself grows newer all the time.
                news[b, i, k] = age if has_sent else news[b, i, k] + rise[i]
                from_sender_m2 = squared_distance(believed_m[b, i], sender, k)
                if k != sender and (k == i or from_sender_m2 <= range_m**2):
                    news[b, i, k] += learned
                # The weight w is the cube of the news, so that who has much of it mostly wins.
                priority[k] = math.log(priority_draw[b, k]) / (news[b, i, k] + SLOT_WINDOWS) ** 3
                # Who was silent for a round of turns has failed, or is elsewhere.
                is_heard = timestamp[b, i, k] > NEVER and age < len(priority) * SLOT_WINDOWS
                is_known = k != i and is_heard
                apart_m2 = squared_distance(believed_m[b, i], i, k)
                if is_known and apart_m2 <= (CONTENTION_RANGES * range_m) ** 2:
                    num_near += 1
                    best = max(best, priority[k])
            wins[b, i] = priority[i] > best and num_expected * rarity_draw[b, i] < num_near
            noted_at[b, i] = timestamp[b, i]
    return wins
