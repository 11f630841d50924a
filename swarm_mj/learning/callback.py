"""A session of a run: PPO's loop, held-out evaluations, the best policy, checkpoints, replays."""

import math
import time
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from swarm_mj.learning import checkpoint, held_out, selection
from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.held_out import HeldOut
from swarm_mj.learning.run_folder import (
    CHECKPOINT,
    REPLAYS,
    Accumulator,
    Listener,
    Progress,
    Status,
    TrainingRun,
)
from swarm_mj.learning.selection import Choice, Row
from swarm_mj.policies.policy_config import GnnConfig
from swarm_mj.policies.stored import POLICY, save_policy
from swarm_mj.system.provenance import commit, version

# What PPO logs of itself, by its names.
OPTIMISER = (
    *("train/entropy", "train/explained_variance"),
    *("train/approx_kl", "train/clip_fraction", "train/value_loss"),
)


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    """Ends an evaluation that the listener does not wait for."""


class TrainingCallback(BaseCallback):
    """One session of a run; PPO calls it after every window of a rollout."""

    def __init__(
        self,
        model: PPO,
        run: TrainingRun,
        folder: Path,
        progress: Progress,
        networks: checkpoint.Networks,
        rng: np.random.Generator,
        listener: Listener,
    ) -> None:
        super().__init__()
        self._ppo, self._env = model, env_of(model)
        self._run, self._training, self._limits = run, run.training, run.limits
        self._folder, self._progress, self._networks = folder, progress, networks
        self._rng, self._listener = rng, listener
        self._counted_s, self._saved_s = time.monotonic(), -np.inf  # counted: in the progress
        self._aoi = float("nan")
        self._goes_on = True

    @property
    def decisions(self) -> int:
        """Team decisions in all sessions so far."""
        return self._ppo.num_timesteps // self._env.num_envs * self._env.num_teams

    @property
    def minutes(self) -> float:
        """Minutes of all sessions so far."""
        return self._progress.minutes + (time.monotonic() - self._counted_s) / 60.0

    def learn(self) -> None:
        """Alternate rollouts and PPO's passes over them until a limit, or the listener, ends it."""
        model, budget = self._ppo, self._limits.decisions or math.inf
        model._setup_learn(0, self, reset_num_timesteps=model.num_timesteps == 0)
        # PPO's own loop knows no minutes and no stall, and would dump its logs by itself.
        while True:
            is_last = self.decisions >= budget or self._is_time() or not self._goes_on
            # Less --patience may end a run between evaluations: the last weights are judged first.
            self.between_rollouts(is_last=is_last or self._has_stalled())
            if is_last or not self._goes_on or self._has_stalled():
                return
            env = model.get_env()
            assert env is not None
            model.collect_rollouts(env, self, model.rollout_buffer, model.n_steps)
            model.train()

    def _has_stalled(self) -> bool:
        return selection.has_stalled(self._progress.curve, self._limits.patience)

    def _is_time(self) -> bool:
        """Return whether the minutes are over, except those that the selection will take."""
        limit, evaluation = self._limits.minutes, self._progress.evaluation_minutes
        if limit is None:
            return False
        reserved = selection.reserved_minutes(self._training, self.decisions, evaluation, limit)
        return self.minutes + reserved >= limit

    def _on_step(self) -> bool:
        costs = self._env.costs
        self._progress.since_evaluation.add(costs)
        self._aoi = float(np.mean([each.age_windows.mean() for each in costs]))
        self._tell()
        return True

    def _on_rollout_end(self) -> None:
        # PPO's own mean is over the rows it learns from; over all rows, a decision's negative
        # log-probability has the entropy for its mean.
        log_p = self._ppo.rollout_buffer.log_probs
        self.logger.record("train/entropy", -float(log_p.mean()))

    def _tell(self, evaluated: float | None = None, what: str = "Training") -> None:
        its = {"decisions": self.decisions, "minutes": self.minutes, "aoi": self._aoi}
        status = Status(**its, progress=self._progress, evaluated=evaluated, what=what)
        self._goes_on = self._listener(status) and self._goes_on

    def between_rollouts(self, *, is_last: bool) -> None:
        """Evaluate, record a replay and keep a checkpoint, each if it is due."""
        progress, decisions, logged = self._progress, self.decisions, self.logger.name_to_value
        self._check_finite(decisions)
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
            network = checkpoint.acting_network(self._ppo)
            held_out.record_replay(self._training, network, decisions, self._folder / REPLAYS)
            progress.next_replay = (decisions // every + 1) * every
        is_old = time.monotonic() - self._saved_s >= self._limits.checkpoint_every_s
        if is_old or is_due or is_last or not self._goes_on:
            self._save()

    def _save(self) -> None:
        self._count_time()
        state = (self._ppo, self._rng, self._progress, self._networks)
        checkpoint.save(self._folder / CHECKPOINT, self._training, *state)
        self._saved_s = time.monotonic()

    def _count_time(self) -> None:
        """Move the time since the last call into the progress."""
        now_s = time.monotonic()
        self._progress.minutes += (now_s - self._counted_s) / 60.0
        self._progress.since_evaluation.seconds += now_s - self._counted_s
        self._counted_s = now_s

    def _evaluate(self, decisions: int) -> None:
        """Fly the held-out missions, log, and keep the policy if it is the best."""
        progress, every = self._progress, self._training.evaluate_every
        network = checkpoint.acting_network(self._ppo)
        try:
            others = self._references()
            self._count_time()
            means, begun = progress.since_evaluation.means(), progress.minutes
            on_window = partial(self._on_window, "Evaluating")
            costs = held_out.evaluate(self._training, network.to(self._ppo.device), on_window)
        except Stopped:
            return
        self._count_time()
        progress.evaluation_minutes = progress.minutes - begun
        progress.since_evaluation = Accumulator()
        progress.next_evaluation = (decisions // every + 1) * every
        known = {name: x for name, x in asdict(costs).items() if x is not None}
        row = {"decisions": float(decisions), "minutes": progress.minutes, **known, **others}
        progress.curve.append(row | means | progress.optimiser)
        for name, value in progress.curve[-1].items():
            self.logger.record(name if "/" in name else f"held_out/{name}", value)
        self.logger.dump(decisions)
        progress.write_curve(self._folder)
        self._networks[decisions] = network
        kept = {int(row["decisions"]) for row in selection.candidates(progress.curve)}
        for dropped in self._networks.keys() - kept:
            del self._networks[dropped]
        if costs.objective < progress.best_objective:
            progress.best_objective, progress.choice = costs.objective, None
            self._keep(decisions, costs, None)
        self._tell()

    def _references(self) -> Row:
        """Return the costs of hand-written policies on the held-out missions, flown once a run."""
        if self._progress.curve:
            first = self._progress.curve[0]
            return {name: first[name] for name in first if name in selection.REFERENCE_COLUMNS}
        on_window = partial(self._on_window, "Flying others")
        return held_out.reference_columns(self._training, on_window)

    def choose(self) -> None:
        """Choose the policy that is kept, once nothing is left to train and if none is chosen."""
        progress = self._progress
        if not (self._goes_on and progress.curve) or progress.has_chosen:
            return
        on_window = partial(self._on_window, "Choosing")
        try:
            flown = self._training, progress.curve, self._networks
            choice, costs = held_out.choose(*flown, on_window)
        except Stopped:
            return
        self._keep(choice.decisions, costs, choice)
        progress.choice = choice
        self._save()

    def _on_window(self, what: str, share: float) -> None:
        self._tell(share, what)
        if not self._goes_on:
            raise Stopped

    def _keep(self, decisions: int, costs: HeldOut, choice: Choice | None) -> None:
        """Store the policy of the evaluation after so many decisions, with its costs."""
        training = self._training
        (row,) = (each for each in self._progress.curve if each["decisions"] == decisions)
        made = {"command": self._run.command, "decisions": decisions, "minutes": row["minutes"]}
        config = GnnConfig(
            network=training.network,
            features=training.features,
            silence_logit=training.silence_logit,
            training=asdict(training) | made,
            evaluation=asdict(costs) | held_out.notes_of(training, choice),
            commit=commit(),
            version=version(),
        )
        save_policy(self._folder / POLICY, self._networks[decisions], config)

    def _check_finite(self, decisions: int) -> None:
        """Raise ValueError if training has diverged; the last checkpoint is from before that."""
        if not all(torch.isfinite(weight).all() for weight in self._ppo.policy.parameters()):
            raise ValueError(
                f"the network's weights are no longer finite after {decisions} decisions; begin a "
                "new run with a lower learning rate"
            )
