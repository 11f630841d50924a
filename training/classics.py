"""Classic schedulers of the age of information, as own policies beside the package's.

    swarm-mj evaluate --policy training.classics:AgeDebt training.classics:AgeDifference tdma
    python training/classics.py    # tunes their numbers: training/results/classics-tuning.csv

Age Difference and Age Debt (Tripathi, Talak and Modiano 2021, arXiv 2111.09217) are central: in
each slot those robots transmit whose packets have the largest weight. In Age Difference the weight
of a link is by how much its receiver is behind its sender, summed over all flows. In Age Debt every
pair of robots has a virtual queue, its debt: the age above a target, summed up. Slots are chosen to
make the Lyapunov drift of all queues small: the fall of each age counts by its debt.

In age-threshold slotted ALOHA (Yang, Pappas, Quek and Haenggi 2023, arXiv 2306.09787) a robot is
silent until its age reaches a threshold. From then on it transmits with a probability.

What is adapted: every robot is a source, all others are destinations, and one packet carries all
flows, so a link's weight is a sum over flows where the papers choose a flow. The exact set of
largest weight is hard to find under this radio; senders are added one by one while the weight
grows. A broadcast is not acknowledged, so in ALOHA a robot's age is the time since it transmitted.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.cli import script
from swarm_mj.mission import Mission, paper
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import (
    BroadcastPolicy,
    CentralisedPolicy,
    Parameters,
    Policy,
    two_broadcasts,
)
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import LocalViews
from swarm_mj.protocol.window_protocols import DoubleBroadcast
from swarm_mj.radio.links import Links, air_of, listen
from swarm_mj.radio.mission_radio import TrueLinks, radio_of
from swarm_mj.radio.reception import NOBODY
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.compiled import compiled
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.writing import Output, check_outputs, write_csv

RESULTS = Path(__file__).resolve().parent / "results"
TASKS = ("stationary", "random-walk", "flocking")
# The best of the grids below by task, over 8 missions from seed 5000: classics-tuning.csv.
TARGETS = {"stationary": 2.5, "random-walk": 0.0, "flocking": 0.0}  # [windows]
ACCESS = {"stationary": (16, 0.2), "random-walk": (16, 0.2), "flocking": (16, 0.3)}  # [slots], [1]
TARGET_GRID = (0.0, 2.5, 5.0, 10.0)
THRESHOLD_GRID = (8, 16, 32)
PROBABILITY_GRID = (0.1, 0.2, 0.3)


class MaxWeight(CentralisedPolicy):
    """Those broadcast whose packets have the largest weight together, chosen one by one."""

    uses = "all buffers, all true positions and the true channel except its fades, at every moment"

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio, in free space unless informed otherwise."""
        self._truth = TrueLinks(radio=radio_of(mission))

    def window(self, mission: Mission) -> DoubleBroadcast:
        """Return what the robots do in a window: they broadcast twice, unanswered."""
        return two_broadcasts(mission)

    def inform(self, truth: TrueLinks) -> None:
        """Decide by the true channel from now on."""
        self._truth = truth

    def weights(self, age: Float[np.ndarray, "B N N"]) -> Float[np.ndarray, "B N N"]:
        """Return the weight of a fall of each age, given all ages [windows]."""
        return np.ones_like(age)

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return `BROADCAST` for those who transmit."""
        timestamp = views.buffers.timestamp
        weight = self.weights(views.now[:, None, None] - timestamp)
        recipient = views.silence.copy()
        for b, now in enumerate(views.now):
            sent = timestamp[b].copy()
            np.fill_diagonal(sent, now + SLOT_WINDOWS)
            gain = _gains(sent, timestamp[b], weight[b])
            sends = heaviest(gain, self._truth.links(states.position_m[b], b))
            recipient[b, sends] = BROADCAST
        return recipient


class AgeDifference(MaxWeight):
    """Lowers the differences of neighbours' ages (III of arXiv 2111.09217)."""


class AgeDebt(MaxWeight):
    """Lowers the ages whose debt is largest (IV of arXiv 2111.09217)."""

    def __init__(self, mission: Mission, target: float | None = None) -> None:
        """Take the age that every pair should have at most [windows], tuned unless given."""
        super().__init__(mission)
        self._target = TARGETS[mission.task] if target is None else target

    @property
    def parameters(self) -> Parameters:
        """The target, for results."""
        return {"target": self._target}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forget all debt; arguments as in `Policy.start`."""
        self.debt = np.zeros((len(rngs), num_robots, num_robots))

    def weights(self, age: Float[np.ndarray, "B N N"]) -> Float[np.ndarray, "B N N"]:
        """Return the debts after this slot's ages were added and the target was paid off."""
        self.debt = np.maximum(0.0, self.debt + age - self._target)
        return self.debt


class AgeThresholdAloha(BroadcastPolicy):
    """Robots are silent for some slots after each transmission, then transmit at random."""

    uses = "when it transmitted last"

    def __init__(self, mission: Mission, access: tuple[int, float] | None = None) -> None:
        """Take threshold [slots] and probability in each slot, tuned unless given."""
        self._threshold, self._probability = ACCESS[mission.task] if access is None else access

    @property
    def parameters(self) -> Parameters:
        """The threshold and the probability, for results."""
        return {"threshold": self._threshold, "access_probability": self._probability}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Let everyone be of an age, each of another; arguments as in `Policy.start`."""
        self._draws = Stream(rngs, uniform, (num_robots,))
        # In step, all robots would wait for the threshold together.
        self._age = np.floor(self._draws.next() * (self._threshold + 1))  # [slots]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who is old enough and draws a transmission."""
        is_old = self._age >= self._threshold
        sends = is_old & (self._draws.next() < self._probability)
        self._age = np.where(sends, 1.0, self._age + 1.0)
        return sends & (views.silence >= 0)


@compiled()
def _gains(
    sent: Float[np.ndarray, "N N"],
    held: Float[np.ndarray, "N N"],
    weight: Float[np.ndarray, "N N"],
) -> Float[np.ndarray, "N N"]:
    """Return the weighted falls of j's ages if it decodes i."""
    gain = np.zeros_like(sent)
    for i in range(len(sent)):
        for j in range(len(sent)):
            for k in range(len(sent)):
                gain[i, j] += weight[j, k] * max(0.0, sent[i, k] - held[j, k])
    return gain


@compiled()
def heaviest(gain: Float[np.ndarray, "N N"], links: Links) -> Bool[np.ndarray, "N"]:
    """Return senders, added one by one while the gain of all receptions grows by that."""
    num_robots = gain.shape[0]
    listens = np.ones(num_robots, dtype=np.bool_)
    heard, probability = np.arange(num_robots), np.zeros(num_robots)
    most = 0.0
    while True:
        air, best = air_of(links, ~listens), NOBODY
        for i in range(num_robots):
            if listens[i]:
                listen(links, air, i, listens, heard, probability)
                total = 0.0
                for j in range(num_robots):
                    total += probability[j] * gain[heard[j], j]
                if total > most:
                    best, most = i, total
        if best == NOBODY:
            return ~listens
        listens[best] = False


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """What is tuned on which missions."""

    episodes: int = setting(8, "missions a number", low=2, high=10_000)
    seed: int = setting(5000, "of the first mission; an evaluation's begin at 1000")
    num_windows: int = setting(300, "length, in windows", low=1, high=100_000)
    out: Path = setting(RESULTS / "classics-tuning.csv", "the table", metavar="FILE.csv")


@dataclass(frozen=True, kw_only=True)
class Tried:
    """A row of the table: what one number costs."""

    policy: str
    task: str
    target: float | None = None  # of Age Debt [windows]
    threshold: int | None = None  # of ALOHA [slots]
    access_probability: float | None = None
    aoi_mean: float
    aoi_sem: float
    episodes: int
    first_seed: int
    commit: str


def tried(mission: Mission, policy: Policy, settings: Tuning) -> Tried:
    """Return the mean age of a policy's missions."""
    swarm = Swarm(mission, range(settings.seed, settings.seed + settings.episodes))
    age = np.mean([swarm.step(policy).age_windows for _ in range(mission.num_windows)], axis=0)
    return Tried(
        policy=type(policy).__name__,
        task=mission.task,
        aoi_mean=round(float(np.mean(age)), 4),
        aoi_sem=round(float(np.std(age, ddof=1)) / math.sqrt(len(age)), 4),
        episodes=len(age),
        first_seed=settings.seed,
        commit=commit() or "",
        **policy.parameters,  # type: ignore[arg-type]
    )


def run(settings: Tuning) -> int:
    """Tune, write the table and print the best; return the exit code."""
    check_outputs(Output("table", settings.out, ".csv"))
    rows: list[Tried] = []
    for task in TASKS:
        mission = paper(task, num_windows=settings.num_windows)
        access = [(t, p) for t in THRESHOLD_GRID for p in PROBABILITY_GRID]
        debts = [tried(mission, AgeDebt(mission, target), settings) for target in TARGET_GRID]
        alohas = [tried(mission, AgeThresholdAloha(mission, each), settings) for each in access]
        for found in (debts, alohas):
            print(min(found, key=lambda row: row.aoi_mean))
            rows += found
    write_csv(settings.out, [field.name for field in fields(Tried)], (asdict(row) for row in rows))
    return 0


if __name__ == "__main__":
    sys.exit(script(Tuning, run))
