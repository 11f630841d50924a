"""A ceiling for teams at rest: periodic schedules, searched for offline on the true positions.

    swarm-mj evaluate --task stationary --policy training.ceiling:Annealed planner --episodes 8

No team could fly it: a centre knows all positions before the mission, and searches for seconds. It
shows that a schedule of two broadcasts a window exists whose age is as low as it has, so the
optimum lies between that age and the floor of `bounds.py`.

The search begins with the best period of the planner's plan, and goes on by simulated annealing:
a transmitter is added, removed, replaced or moved to another slot, or two slots change places. What
is kept is judged by the age of the schedule flown again and again (Eq. 10), as the mission counts
it: at the ends of windows. Index order: `[s, i]` is robot `i` in slot `s` of the period.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float32, Int

from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import CentralisedPolicy, two_broadcasts
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW, observe_own
from swarm_mj.protocol.window import LocalViews
from swarm_mj.protocol.window_protocols import DoubleBroadcast
from swarm_mj.radio.links import Links, air_of
from swarm_mj.radio.mission_radio import TrueLinks, radio_of
from swarm_mj.radio.reception import decoded, incoming_at
from swarm_mj.system.compiled import compiled

PERIODS = (12, 16, 20, 24, 28)  # that the plan is cut into, and searched further [slots]
SETTLED = 120  # slots after which a plan of a team that knew nothing repeats itself roughly
PLANNED = 180  # slots that are planned
TRIALS = 60_000  # changes that a search tries
SHORT_TRIALS = 6_000  # of each period, of which the best goes on
# A rise of the age that is kept in one of e cases, first and last [windows].
HOT = 0.06
COLD = 0.003
NUM_REPEATS = 4  # of a period until its ages repeat; the last one counts
NEVER_SLOTS = -400.0  # the timestamp of what was never heard


class Annealed(CentralisedPolicy):
    """Flies the schedule found for each mission's positions; robots must rest."""

    uses = "all true positions and the true channel, and a search for seconds before the mission"

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy; raise ValueError unless the mission's robots rest."""
        if mission.task != "stationary":
            raise ValueError(
                f"task must be stationary, not {mission.task}: the schedule is of places that stay"
            )
        self._truth = TrueLinks(radio=radio_of(mission))

    def window(self, mission: Mission) -> DoubleBroadcast:
        """Return what the robots do in a window: they broadcast twice, unanswered."""
        return two_broadcasts(mission)

    def inform(self, truth: TrueLinks) -> None:
        """Search with the true channel from now on."""
        self._truth = truth

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:  # noqa: ARG002
        """Forget the last missions' schedules; arguments as in `Policy.start`."""
        self._rngs = rngs
        self._schedules = []

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return who broadcasts in the next slot of each mission's period."""
        if not self._schedules:
            self._schedules = [
                schedule(self._truth.links(states.position_m[b], b), rng)
                for b, rng in enumerate(self._rngs)
            ]
        slot = np.rint(SLOTS_PER_WINDOW * views.now).astype(int)
        sends = [period[s % len(period)] for period, s in zip(self._schedules, slot, strict=True)]
        return np.where(sends, BROADCAST, views.silence)


def schedule(
    links: Links, rng: np.random.Generator, trials: int = TRIALS
) -> Bool[np.ndarray, "L N"]:
    """Return who transmits in each slot of a period, by a search of this many trials."""
    plan = Plan(links, PlannerSettings())
    planned = np.stack([plan.transmits(slot) for slot in range(PLANNED)])
    short = min(SHORT_TRIALS, trials // len(PERIODS))
    found = []
    for length in PERIODS:
        period = _best_cut(planned, length, links)
        best, age = anneal(period, links, rng, short, HOT / 2.0, COLD)
        found.append((age, len(found), best))
    _, _, best = min(found)
    return anneal(best, links, rng, trials, HOT, COLD)[0]


def _best_cut(planned: Bool[np.ndarray, "P N"], length: int, links: Links) -> np.ndarray:
    """Return the piece of a plan that has the lowest age when it repeats itself."""
    pieces = [planned[s : s + length] for s in range(SETTLED, len(planned) - length, 4)]
    return min(pieces, key=lambda piece: mean_age(receptions(piece, links)))


@compiled()
def receptions(period: Bool[np.ndarray, "L N"], links: Links) -> Int[np.ndarray, "L N"]:
    """Return whom each robot decodes in each slot; itself is nobody."""
    heard = np.empty(period.shape, dtype=np.int64)
    for s in range(period.shape[0]):
        _listen(period[s], links, heard[s])
    return heard


@compiled()
def _listen(transmits: Bool[np.ndarray, "N"], links: Links, heard: Int[np.ndarray, "N"]) -> None:
    """Fill `heard` by Eqs. 3 and 4."""
    air = air_of(links, transmits)
    for j in range(heard.shape[0]):
        is_lost = transmits[j] or air.strongest[j] <= 0.0
        heard[j] = (
            j if is_lost else decoded(incoming_at(air, j), j, links.noise_mw, links.threshold)
        )


@compiled()
def mean_age(heard: Int[np.ndarray, "L N"]) -> float:
    """Return the age of information of a period that repeats itself, at ends of windows (Eq. 10).

    The period is an even number of slots; what is never heard counts as `NEVER_SLOTS`.
    """
    length, num_robots = heard.shape
    timestamp = np.full((num_robots, num_robots), np.float32(NEVER_SLOTS))
    now = 0.0
    age = 0.0
    for slot in range(NUM_REPEATS * length):
        now += 1.0
        observe_own(timestamp, now)
        _merge(timestamp, heard[slot % length])
        is_end = slot % SLOTS_PER_WINDOW == SLOTS_PER_WINDOW - 1
        if is_end and slot >= (NUM_REPEATS - 1) * length:
            age += _total_age(timestamp, now)
    return age / (num_robots * num_robots * length)


@compiled(fastmath={"nnan", "nsz"})
def _merge(timestamp: Float32[np.ndarray, "N N"], heard: Int[np.ndarray, "N"]) -> None:
    """Merge what everyone decoded (Eq. 8); who is decoded decodes nobody: its row is as sent."""
    for j in range(heard.shape[0]):
        if heard[j] != j:
            row = timestamp[j]
            sent = timestamp[heard[j]]
            for k in range(heard.shape[0]):
                row[k] = max(row[k], sent[k])


@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _total_age(timestamp: Float32[np.ndarray, "N N"], now: float) -> float:
    total = np.float32(0.0)
    end = np.float32(now)
    for j in range(timestamp.shape[0]):
        for k in range(timestamp.shape[0]):
            total += end - timestamp[j, k]
    return float(total)


@compiled()
def anneal(
    period: Bool[np.ndarray, "L N"],
    links: Links,
    rng: np.random.Generator,
    trials: int,
    hot: float,
    cold: float,
) -> tuple[Bool[np.ndarray, "L N"], float]:
    """Return the best schedule found, and its age [windows]."""
    period = period.copy()
    best = period.copy()
    heard = receptions(period, links)
    age = mean_age(heard)
    least = age
    length = period.shape[0]
    for trial in range(trials):
        temperature = hot * (cold / hot) ** (trial / trials)
        s = int(rng.random() * length)
        # News travels from slot to slot, so near slots change places more often.
        step = 1 + int(rng.random() ** 3 * (length - 1))
        u = (s + step) % length if rng.random() < 0.5 else (s - step) % length
        before = period[s].copy(), period[u].copy(), heard[s].copy(), heard[u].copy()
        _change(period[s], period[u], rng)
        _listen(period[s], links, heard[s])
        _listen(period[u], links, heard[u])
        changed = mean_age(heard)
        if changed <= age or rng.random() < math.exp((age - changed) / temperature):
            age = changed
            if age < least:
                least = age
                best[:] = period
        else:
            period[s], period[u], heard[s], heard[u] = before
    return best, least


@compiled()
def _change(
    slot: Bool[np.ndarray, "N"], other: Bool[np.ndarray, "N"], rng: np.random.Generator
) -> None:
    """Change a slot's transmitters, or those of two slots, at random."""
    num_robots = slot.shape[0]
    kind = rng.random()
    k = int(rng.random() * num_robots)
    m = int(rng.random() * num_robots)
    for _ in range(4 * num_robots):  # a robot that transmits, if there is one
        if slot[k]:
            break
        k = int(rng.random() * num_robots)
    if kind < 0.25:
        slot[m] = not slot[m]
    elif kind < 0.5:
        slot[k] = False
        slot[m] = True
    elif kind < 0.8:
        other[k] = other[k] or slot[k]
        slot[k] = False
    else:
        for i in range(num_robots):
            slot[i], other[i] = other[i], slot[i]
