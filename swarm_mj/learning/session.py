"""What happens between a training run's rollouts: evaluations, the best policy, checkpoints."""

import csv
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from swarm_mj.flight import fly
from swarm_mj.gnn import AggregationGnn
from swarm_mj.learning import checkpoint
from swarm_mj.learning.actor_critic import GnnActorCritic
from swarm_mj.learning.checkpoint import Progress, missions_of
from swarm_mj.learning.env import MissionsEnv
from swarm_mj.learning.held_out import HeldOut, evaluate, held_out_missions, held_out_policy
from swarm_mj.learning.settings import HELD_OUT_SEED, Training
from swarm_mj.policies.policy_config import PolicyConfig
from swarm_mj.policies.stored import save_policy
from swarm_mj.provenance import commit, version
from swarm_mj.recorder import Recorder
from swarm_mj.swarm import Swarm
from swarm_mj.whole_file import whole_file

SETTINGS, CHECKPOINT, CURVE = "settings.json", "checkpoint.pt", "curve.csv"
POLICY, REPLAYS = "policy", "replays"


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    """The run has reached a limit, or its listener has had enough; all is kept."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How far a run goes, and what it leaves behind on the way."""

    decisions: int | None = None  # team decisions in all sessions together
    minutes: float | None = None  # in all sessions together, evaluations included
    replay_every: int | None = None  # team decisions between two replays
    checkpoint_every_s: float = 10.0  # least time between two checkpoints


@dataclass(frozen=True, kw_only=True)
class Status:
    """What a listener is told after every window, and around every evaluation."""

    decisions: int
    minutes: float
    aoi: float  # of the missions in training, in the last window [windows]
    held_out: HeldOut | None  # of the last evaluation in this session
    is_evaluating: bool


Listener = Callable[[Status], bool]  # returns whether to go on; if not, the rollout is finished


class Session(BaseCallback):
    """One sitting of a run; PPO calls it, and waits for it between rollouts."""

    def __init__(
        self,
        training: Training,
        folder: Path,
        limits: Limits,
        progress: Progress,
        rng: np.random.Generator,
        listener: Listener,
        command: str,
    ) -> None:
        """Takes what it needs; PPO brings itself."""
        super().__init__()
        self._training, self._folder, self._limits = training, folder, limits
        self._progress, self._rng, self._listener = progress, rng, listener
        self._command = command
        self._start_s = time.monotonic()
        self._minutes_before = progress.minutes
        self._saved_s = -np.inf
        self._aoi = float("nan")
        self._held_out: HeldOut | None = None
        self._goes_on = True
        self._tally = _Tally()

    @property
    def decisions(self) -> int:
        """Team decisions in all sessions so far."""
        env = missions_of(self._ppo)
        return self.model.num_timesteps // env.num_envs * env.num_teams

    @property
    def _ppo(self) -> PPO:
        assert isinstance(self.model, PPO)
        return self.model

    @property
    def minutes(self) -> float:
        """Of all sessions so far."""
        return self._minutes_before + (time.monotonic() - self._start_s) / 60.0

    def finish(self) -> None:
        """Keeps what the last rollout led to."""
        self._between_rollouts(is_last=True)

    def _on_rollout_start(self) -> None:
        limit = self._limits.minutes
        is_late = limit is not None and self.minutes >= limit
        self._between_rollouts(is_last=is_late or not self._goes_on)
        if is_late or not self._goes_on:
            raise Stopped

    def _on_step(self) -> bool:
        env = missions_of(self._ppo)
        self._tally.add(env)
        self._aoi = float(np.mean([outcome.age_windows.mean() for outcome in env.outcomes]))
        self._tell(is_evaluating=False)
        return True

    def _tell(self, *, is_evaluating: bool) -> None:
        status = Status(
            decisions=self.decisions,
            minutes=self.minutes,
            aoi=self._aoi,
            held_out=self._held_out,
            is_evaluating=is_evaluating,
        )
        self._goes_on = self._listener(status) and self._goes_on

    def _between_rollouts(self, *, is_last: bool) -> None:
        progress, decisions = self._progress, self.decisions
        is_new = not progress.curve or progress.curve[-1]["decisions"] < decisions
        is_due = decisions >= progress.next_evaluation
        if is_new and (is_due or (is_last and self._goes_on)):
            self._evaluate(decisions)
        every = self._limits.replay_every
        if every and decisions >= progress.next_replay:
            progress.next_replay = (decisions // every + 1) * every
            self._record_replay(decisions)
        now_s = time.monotonic()
        if is_last or now_s - self._saved_s >= self._limits.checkpoint_every_s:
            progress.minutes = self.minutes
            checkpoint.save(self._folder / CHECKPOINT, self._ppo, self._rng, progress)
            self._saved_s = now_s

    def _evaluate(self, decisions: int) -> None:
        """Flies the held-out missions, logs, and keeps the policy if it is the best."""
        progress, every = self._progress, self._training.evaluate_every
        self._tell(is_evaluating=True)
        network = acting_network(self._ppo)
        self._held_out = held_out = evaluate(self._training, network)
        progress.next_evaluation = (decisions // every + 1) * every
        row = {"decisions": float(decisions), "minutes": self.minutes, **held_out.to_json()}
        row |= self._tally.means() | self._optimiser_means()
        self._tally = _Tally()
        progress.curve.append(row)
        write_curve(self._folder / CURVE, progress.curve)
        for name, value in row.items():
            self.logger.record(name if "/" in name else f"held_out/{name}", value)
        self.logger.dump(decisions)
        if held_out.objective < progress.best_objective:
            progress.best_objective = held_out.objective
            save_policy(self._folder / POLICY, network, self._config(decisions, held_out))
        self._tell(is_evaluating=False)

    def _optimiser_means(self) -> dict[str, float]:
        """What PPO logged of its last pass over a rollout."""
        names = ("entropy_loss", "explained_variance", "approx_kl", "clip_fraction", "value_loss")
        logged = self.logger.name_to_value
        means = {
            f"train/{name}": float(logged[f"train/{name}"])
            for name in names
            if f"train/{name}" in logged
        }
        if "train/entropy_loss" in means:
            means["train/entropy"] = -means.pop("train/entropy_loss")
        return means

    def _config(self, decisions: int, held_out: HeldOut) -> PolicyConfig:
        training = self._training
        return PolicyConfig(
            network=training.network,
            features=training.features,
            silence_logit=training.silence_logit,
            training={
                **training.to_json(),
                "command": self._command,
                "decisions": decisions,
                "minutes": self.minutes,
            },
            evaluation={
                **held_out.to_json(),
                "missions": training.held_out * len(training.robots),
                "first_seed": HELD_OUT_SEED,
                "chosen_by": "the least objective of all evaluations on these same missions",
            },
            commit=commit(),
            version=version(),
        )

    def _record_replay(self, decisions: int) -> None:
        """The first held-out mission, as the policy flies it now."""
        from swarm_mj.replay.write import write_replay  # rerun takes its time to import

        training = self._training
        mission = held_out_missions(training)[0]
        swarm = Swarm(mission, [HELD_OUT_SEED])
        policy = held_out_policy(training, acting_network(self._ppo), mission)
        recorder = Recorder(swarm, observer=0, has_response=True)
        for flown in fly(swarm, policy):
            recorder.add(flown)
        path = self._folder / REPLAYS / f"decisions-{decisions:09d}.rrd"
        config: dict[str, object] = {
            "decisions": decisions,
            "seed": HELD_OUT_SEED,
            "training seed": training.seed,
        }
        write_replay(recorder.log(), mission, config, path)


def acting_network(model: PPO) -> AggregationGnn:
    """A copy of the network that acts."""
    assert isinstance(model.policy, GnnActorCritic)
    return model.policy.acting_network()


class _Tally:
    """What the missions in training cost between two evaluations."""

    def __init__(self) -> None:
        self._start_s = time.monotonic()
        self._age, self._attempted, self._delivered = 0.0, 0, 0
        self._teams = 0

    def add(self, env: MissionsEnv) -> None:
        """Adds a window of all missions."""
        self._teams += env.num_teams
        for outcome in env.outcomes:
            self._age += float(outcome.age_windows.sum())
            self._attempted += int(outcome.attempted.sum())
            self._delivered += int(outcome.delivered.sum())

    def means(self) -> dict[str, float]:
        """Per mission and window; empty before the first."""
        if not self._teams:
            return {}
        return {
            "rollout/aoi": self._age / self._teams,
            "rollout/packets_per_window": self._attempted / self._teams,
            "rollout/delivery_ratio": self._delivered / max(1, self._attempted),
            "rollout/decisions_per_s": self._teams / (time.monotonic() - self._start_s),
        }


def write_curve(path: Path, curve: list[dict[str, float]]) -> None:
    """Writes a learning curve, one row an evaluation.

    Args:
        path: The CSV file.
        curve: Rows by name; the later ones may have names that the first lacks.
    """
    names = list(dict.fromkeys(name for row in curve for name in row))
    with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(curve)
