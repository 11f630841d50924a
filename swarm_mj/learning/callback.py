"""What PPO calls during a run: held-out evaluations, the best policy, checkpoints, replays."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from swarm_mj.gnn.network import AggregationGnn
from swarm_mj.io.provenance import commit, version
from swarm_mj.learning import checkpoint
from swarm_mj.learning.actor_critic import GnnActorCritic
from swarm_mj.learning.held_out import HeldOut, evaluate, record_replay
from swarm_mj.learning.run_folder import (
    CHECKPOINT,
    CURVE,
    POLICY,
    REPLAYS,
    Accumulator,
    Progress,
    Run,
    write_curve,
)
from swarm_mj.learning.settings import HELD_OUT_SEED
from swarm_mj.learning.vec_env import missions_of
from swarm_mj.policies.policy_config import PolicyConfig
from swarm_mj.policies.stored import save_policy

OPTIMISER = tuple(
    f"train/{name}"
    for name in ("entropy", "explained_variance", "approx_kl", "clip_fraction", "value_loss")
)


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    """The run has reached a limit, or its listener has had enough; all is kept."""


@dataclass(frozen=True, kw_only=True)
class Status:
    """What a listener is told after every window, and during evaluations."""

    decisions: int
    minutes: float
    aoi: float  # of the missions in training, in the last window [windows]
    progress: Progress  # with the curve so far; the run's own, so only to be read
    evaluated: float | None  # the share of an evaluation that is flown; None while training


# Returns whether to go on; if not, the rollout is finished, or the evaluation left for later.
Listener = Callable[[Status], bool]


class TrainingCallback(BaseCallback):
    """One sitting of a run; PPO calls it, and waits for it between rollouts."""

    def __init__(
        self,
        model: PPO,
        run: Run,
        folder: Path,
        progress: Progress,
        rng: np.random.Generator,
        listener: Listener,
    ) -> None:
        super().__init__()
        self._ppo = model
        self._run = run
        self._training = run.training
        self._limits = run.limits
        self._folder = folder
        self._progress = progress
        self._rng = rng
        self._listener = listener
        self._env = missions_of(model)
        self._counted_s = time.monotonic()  # up to here, time is in the progress
        self._saved_s = -np.inf
        self._aoi = float("nan")
        self._goes_on = True

    @property
    def decisions(self) -> int:
        """Team decisions in all sessions so far."""
        return self._ppo.num_timesteps // self._env.num_envs * self._env.num_teams

    @property
    def minutes(self) -> float:
        """Of all sessions so far."""
        return self._progress.minutes + (time.monotonic() - self._counted_s) / 60.0

    def _on_rollout_start(self) -> None:
        limit = self._limits.minutes
        is_last = (limit is not None and self.minutes >= limit) or not self._goes_on
        self.between_rollouts(is_last=is_last)
        if is_last or not self._goes_on:
            raise Stopped

    def _on_step(self) -> bool:
        costs = [transition.costs for transition in self._env.transitions]
        self._progress.since_evaluation.add(costs)
        self._aoi = float(np.mean([each.age_windows.mean() for each in costs]))
        self._tell()
        return True

    def _on_rollout_end(self) -> None:
        # PPO's own mean is over the rows it learns from; over all rows, a decision's negative
        # log-probability has the entropy for its mean.
        log_p = self._ppo.rollout_buffer.log_probs
        self.logger.record("train/entropy", -float(log_p.mean()))

    def _tell(self, evaluated: float | None = None) -> None:
        status = Status(
            decisions=self.decisions,
            minutes=self.minutes,
            aoi=self._aoi,
            progress=self._progress,
            evaluated=evaluated,
        )
        self._goes_on = self._listener(status) and self._goes_on

    def between_rollouts(self, *, is_last: bool) -> None:
        """Evaluates, records a replay and keeps a checkpoint, each if it is due."""
        progress, decisions, logged = self._progress, self.decisions, self.logger.name_to_value
        _check_finite(self._ppo, decisions)
        progress.decisions = decisions
        means = {name: float(logged[name]) for name in OPTIMISER if name in logged}
        progress.optimiser = means or progress.optimiser  # of PPO's last passes over a rollout
        is_new = not progress.curve or progress.curve[-1]["decisions"] < decisions
        is_due = is_new and (is_last or decisions >= progress.next_evaluation)
        if is_due:
            if not progress.curve:
                self._save()  # from the first evaluation on, a run without one has lost it
            self._evaluate(decisions)
        every = self._limits.replay_every
        if every and decisions >= progress.next_replay and self._goes_on:
            network = acting_network(self._ppo)
            record_replay(self._training, network, decisions, self._folder / REPLAYS)
            progress.next_replay = (decisions // every + 1) * every
        is_old = time.monotonic() - self._saved_s >= self._limits.checkpoint_every_s
        if is_old or is_due or is_last or not self._goes_on:
            self._save()

    def _save(self) -> None:
        self._count_time()
        kept = self._folder / CHECKPOINT
        checkpoint.save(kept, self._training, self._ppo, self._rng, self._progress)
        self._saved_s = time.monotonic()

    def _count_time(self) -> None:
        """Moves the time since the last call into the progress."""
        now_s = time.monotonic()
        self._progress.minutes += (now_s - self._counted_s) / 60.0
        self._progress.since_evaluation.seconds += now_s - self._counted_s
        self._counted_s = now_s

    def _evaluate(self, decisions: int) -> None:
        """Flies the held-out missions, logs, and keeps the policy if it is the best."""
        progress, every = self._progress, self._training.evaluate_every
        network = acting_network(self._ppo)
        self._count_time()
        means = progress.since_evaluation.means()
        try:
            held_out = evaluate(self._training, network.to(self._ppo.device), self._on_window)
        except Stopped:
            return
        self._count_time()
        progress.since_evaluation = Accumulator()
        progress.next_evaluation = (decisions // every + 1) * every
        known = {name: x for name, x in asdict(held_out).items() if x is not None}
        row = {"decisions": float(decisions), "minutes": progress.minutes, **known}
        progress.curve.append(row | means | progress.optimiser)
        for name, value in progress.curve[-1].items():
            self.logger.record(name if "/" in name else f"held_out/{name}", value)
        self.logger.dump(decisions)
        write_curve(self._folder / CURVE, progress.curve)
        if held_out.objective < progress.best_objective:
            progress.best_objective = held_out.objective
            save_policy(self._folder / POLICY, network, self._config(decisions, held_out))
        self._tell()

    def _on_window(self, share: float) -> None:
        self._tell(share)
        if not self._goes_on:
            raise Stopped

    def _config(self, decisions: int, held_out: HeldOut) -> PolicyConfig:
        training = self._training
        return PolicyConfig(
            network=training.network,
            features=training.features,
            silence_logit=training.silence_logit,
            training={
                **asdict(training),
                "command": self._run.command,
                "decisions": decisions,
                "minutes": self._progress.minutes,
            },
            evaluation={
                **asdict(held_out),
                "missions": training.held_out * len(training.robots),
                "first_seed": HELD_OUT_SEED,
                "chosen_by": "the least objective of all evaluations on these same missions",
            },
            commit=commit(),
            version=version(),
        )


def acting_network(model: PPO) -> AggregationGnn:
    """A copy of the network that acts."""
    assert isinstance(model.policy, GnnActorCritic)
    return model.policy.acting_network()


def _check_finite(model: PPO, decisions: int) -> None:
    """Raises ValueError if training has diverged; the last checkpoint is from before that."""
    if not all(torch.isfinite(weight).all() for weight in model.policy.parameters()):
        raise ValueError(
            f"the network's weights are no longer finite after {decisions} decisions; begin a new "
            "run with a lower learning rate"
        )
