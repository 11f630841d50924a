"""The training run (III-C): PPO's loop from an empty folder or a checkpoint to a stored policy."""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from swarm_mj.learning import checkpoint, held_out, run_folder, selection
from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.live import LiveTraining
from swarm_mj.learning.loggers import Guarded, Logger
from swarm_mj.learning.ppo import make_model, policy_of
from swarm_mj.learning.run_folder import CHECKPOINT, CURVE, INIT, REPLAYS, SETTINGS, TrainingRun
from swarm_mj.learning.selection import (
    Accumulator,
    Choice,
    CurveRow,
    HeldOutCosts,
    Listener,
    Progress,
)
from swarm_mj.policies.policy_config import GnnConfig
from swarm_mj.policies.stored import POLICY, read_policy, save_gnn
from swarm_mj.system.packages import commit, version
from swarm_mj.system.writing import owned

# What PPO logs of itself, by its names.
OPTIMISER = [
    f"train/{name}"
    for name in ("entropy", "explained_variance", "approx_kl", "clip_fraction", "value_loss")
]


def train(
    run: TrainingRun,
    folder: Path,
    *,
    listener: Listener,
    is_resumed: bool = False,
    logger: Logger | None = None,
    live: LiveTraining | None = None,
    complain: Callable[[str], object] | None = None,
) -> Progress:
    """Train until a limit, or until the listener returns False.

    Args:
        run: The settings, how far to go, and the policy to begin with, if any, which must have the
            settings' network.
        folder: Where the run keeps its files; it is made if it is not there.
        listener: It gets a status after every window, and returns whether to go on.
        is_resumed: Whether to go on from the folder's checkpoint. A run that did not get so far
            starts over.
        logger: It gets the settings and every evaluation of this session, and does not end the run
            if it fails.
        live: It shows every evaluation of this session in a viewer, and likewise does not end the
            run if it fails. The policies are the same with and without it.
        complain: It hears of such a failure; by default it is a warning.

    Returns:
        Where the run stands: its decisions, minutes and learning curve.

    Raises:
        ValueError: The missions cannot be made, the folder is another's, the checkpoint is damaged
            or foreign, or training has diverged.
        OSError: The folder cannot be written.

    Example:
        >>> training = usual_settings("robot", paper("stationary", num_robots=20), robots=[20])
        >>> run = TrainingRun(training=training, limits=Limits(minutes=2.0))
        >>> progress = train(run, Path("runs/mine"), listener=lambda status: True)
    """
    check_folder = run_folder.check_begun if is_resumed else run_folder.check_new
    check_folder(folder)
    with owned(folder / SETTINGS):
        check_folder(folder)  # a run may have begun, or come further, meanwhile
        guarded = Guarded(logger, f"logger {type(logger).__name__}", complain)
        shown = Guarded(live, "viewer", complain)
        session = TrainingSession(run, folder, listener, guarded, shown)
        guarded.do(lambda logger: logger.start(asdict(run), folder))
        try:
            session.learn()
            session.choose()
        finally:
            session.ppo.logger.close()
            guarded.do(lambda logger: logger.finish())
    return session.progress


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    """Ends an evaluation that the listener does not wait for."""


class TrainingSession(BaseCallback):
    """One session of a run; PPO calls it after every window of a rollout."""

    def __init__(
        self,
        run: TrainingRun,
        folder: Path,
        listener: Listener,
        logger: Guarded[Logger],
        live: Guarded[LiveTraining],
    ) -> None:
        """Take a run to its last checkpoint, or else to its beginning; then it can be resumed."""
        super().__init__()
        self._run = run
        self._training = run.training
        self._folder = folder
        self._listener = listener
        self._own_logger = logger
        self._live = live
        self.ppo = make_model(run.training, run.device)
        self._env = env_of(self.ppo)
        self._aoi = math.nan
        self._goes_on = True
        self.progress = Progress()
        self._networks = checkpoint.Networks()
        kept = folder / CHECKPOINT
        own = folder / INIT
        init = None
        # Nothing is written before all that is read has been checked.
        if kept.exists():
            self.progress, self._networks = checkpoint.load(kept, run.training, self.ppo)
        elif run.init is not None:
            path = own if own.exists() else run.init
            init = read_policy(path)
            _, config = init
            its = (config.network, config.own_network)
            if its != (run.training.network, run.training.own_network):
                whose = "the run that begins with it"
                raise ValueError(f"policy {path} has another network than {whose}")
        run_folder.write_run(folder, run)
        if self.progress.curve:
            self.progress.write_curve(folder / CURVE)  # the file may be ahead of the checkpoint
        if init is not None:
            network, config = init
            policy_of(self.ppo).take_acting_network(network)
            if not own.exists():
                save_gnn(own, network, config)
        self.ppo.set_logger(configure(str(folder / run_folder.TENSORBOARD), ["tensorboard"]))
        self._counted_s = time.monotonic()  # until when time is in the progress
        self._saved_s = -math.inf

    def learn(self) -> None:
        """Alternate rollouts and passes over them until a limit or the listener ends it (III-C)."""
        model = self.ppo
        progress = self.progress
        patience = self._run.limits.patience
        model._setup_learn(0, self, reset_num_timesteps=model.num_timesteps == 0)
        if progress.curve:  # what the run that is resumed has come to, if only to look at it
            self._show(lambda _share: None)
        # PPO's own loop knows no minutes and no stall, and would dump its logs by itself.
        while True:
            self._count_time()
            is_last = self._is_over() or not self._goes_on
            # Less --patience may end a run between evaluations: the last weights are judged first.
            self._between_rollouts(is_last=is_last or progress.has_stalled(patience))
            if is_last or not self._goes_on or progress.has_stalled(patience):
                return
            env = model.get_env()
            assert env is not None
            model.collect_rollouts(env, self, model.rollout_buffer, model.n_steps)
            model.train()

    def _is_over(self) -> bool:
        """Return whether a limit is met; of the minutes, the selection will take some."""
        progress = self.progress
        limits = self._run.limits
        if progress.decisions >= (limits.decisions or math.inf):
            return True
        if limits.minutes is None:
            return False
        reserved = selection.reserved_minutes(self._training, progress, limits.minutes)
        return progress.minutes + reserved >= limits.minutes

    def _on_step(self) -> bool:
        costs = self._env.costs
        progress = self.progress
        progress.since_evaluation.add(costs)
        progress.decisions += self._env.num_teams
        self._aoi = float(np.mean([each.age_windows.mean() for each in costs]))
        self._report()
        return True

    def _on_rollout_end(self) -> None:
        # PPO's own mean is over the rows it learns from; over all rows, a decision's negative
        # log-probability has the entropy for its mean.
        log_p = self.ppo.rollout_buffer.log_probs
        self.logger.record("train/entropy", -float(log_p.mean()))

    def _report(self, what: str = "Training", flown: float | None = None) -> None:
        """Call the listener; raise Stopped if it does not wait for the share of a flight to fly."""
        self._count_time()
        status = selection.Status(progress=self.progress, aoi=self._aoi, evaluated=flown, what=what)
        self._goes_on = self._listener(status) and self._goes_on
        if flown is not None and not self._goes_on:
            raise Stopped

    def _count_time(self) -> None:
        """Move the time since the last call into the progress."""
        now_s = time.monotonic()
        self.progress.minutes += (now_s - self._counted_s) / 60.0
        self.progress.since_evaluation.seconds += now_s - self._counted_s
        self._counted_s = now_s

    def _between_rollouts(self, *, is_last: bool) -> None:
        """Evaluate, record a replay and keep a checkpoint, each if it is due."""
        progress = self.progress
        decisions = progress.decisions
        # The last checkpoint was written before the rollout that broke the weights.
        if not all(torch.isfinite(weight).all() for weight in self.ppo.policy.parameters()):
            raise ValueError(
                f"the network's weights are no longer finite after {decisions} decisions; begin a "
                "new run with a lower learning rate"
            )
        logged = self.logger.name_to_value
        means = {name: float(logged[name]) for name in OPTIMISER if name in logged}
        progress.optimiser = means or progress.optimiser  # of PPO's last passes over a rollout
        is_new = not progress.curve or progress.curve[-1].decisions < decisions
        is_due = is_new and (is_last or progress.is_due(self._training.evaluate_every))
        if is_due:
            if not progress.curve:
                self._save()  # from the first evaluation on, a run without one has lost it
            self._evaluate()
        every = self._run.limits.replay_every
        if every and decisions >= progress.next_replay and self._goes_on:
            network = policy_of(self.ppo).acting_network()
            held_out.record_replay(self._training, network, decisions, self._folder / REPLAYS)
            progress.next_replay = decisions - decisions % every + every
        is_old = time.monotonic() - self._saved_s >= self._run.limits.checkpoint_every_s
        if is_old or is_due or is_last or not self._goes_on:
            self._save()

    def _save(self) -> None:
        self._count_time()
        checkpoint.save(
            self._folder / CHECKPOINT, self._training, self.ppo, self.progress, self._networks
        )
        self._saved_s = time.monotonic()

    def _evaluate(self) -> None:
        """Fly the held-out missions, log, and keep the policy if it is the best."""
        progress = self.progress
        training = self._training
        decisions = progress.decisions
        network = policy_of(self.ppo).acting_network()
        try:
            flies_others = partial(self._report, "Flying others")
            if not progress.curve and not progress.references:
                progress.references = held_out.fly_references(training, flies_others)
            self._count_time()
            means = progress.since_evaluation.means()
            begun = progress.minutes
            on_window = partial(self._report, "Evaluating")
            references = progress.references
            costs, behind = held_out.evaluate(training, network, references, on_window)
        except Stopped:
            return
        self._count_time()
        progress.evaluation_minutes = progress.minutes - begun
        progress.since_evaluation = Accumulator()
        others = held_out.reference_columns(references)
        if not others and progress.curve:
            others = progress.curve[0].references  # of a run that 1.0.0 began
        evaluation = CurveRow(
            decisions=decisions,
            minutes=progress.minutes,
            costs=costs,
            references=others | behind,
            training=means | progress.optimiser,
        )
        progress.curve.append(evaluation)
        for name, value in evaluation.columns().items():
            self.logger.record(name if "/" in name else f"held_out/{name}", value)
        self.logger.dump(decisions)
        self._own_logger.do(lambda logger: logger.log(evaluation.columns(), decisions))
        progress.write_curve(self._folder / CURVE)
        self._networks[decisions] = network
        kept = {row.decisions for row in selection.candidates(progress.curve)}
        for dropped in self._networks.keys() - kept:
            del self._networks[dropped]
        if progress.best is evaluation:
            progress.choice = None
            self._keep(decisions, costs, None)
        self._report()
        self._show(partial(self._report, "Showing"))

    def _show(self, on_window: held_out.OnWindow) -> None:
        """Show how the policy under training flies, and the curve, if there is a viewer."""
        if not self._live.is_there:
            return
        progress = self.progress
        network = policy_of(self.ppo).acting_network()
        self._count_time()
        # Showing is no part of the time that decisions take.
        seconds = progress.since_evaluation.seconds
        try:
            flown = held_out.record_first(self._training, network, on_window)
        except Stopped:
            return
        self._live.do(
            lambda live: live.show(self._training, flown, progress.decisions, progress.curve)
        )
        self._count_time()
        progress.since_evaluation.seconds = seconds

    def choose(self) -> None:
        """Choose the policy that is kept, once nothing is left to train and if none is chosen."""
        progress = self.progress
        if not (self._goes_on and progress.curve) or progress.has_chosen:
            return
        report = partial(self._report, "Choosing")
        try:
            choice, costs = held_out.choose(self._training, progress.curve, self._networks, report)
        except Stopped:
            return
        self._keep(choice.decisions, costs, choice)
        progress.choice = choice
        self._save()

    def _keep(self, decisions: int, costs: HeldOutCosts, choice: Choice | None) -> None:
        """Store the policy of the evaluation after this many decisions, with its costs."""
        training = self._training
        row = _row_at(self.progress.curve, decisions)
        made = {
            "command": self._run.command,
            "decisions": decisions,
            "minutes": row.minutes,
        }
        config = GnnConfig(
            network=training.network,
            features=training.features,
            silence_logit=training.silence_logit,
            most_speech=training.most_speech,
            own_network=training.own_network,
            training=asdict(training) | made,
            evaluation={"aoi_sem": costs.aoi_sem}
            | asdict(costs)
            | held_out.notes_of(training, choice),
            commit=commit(),
            version=version(),
        )
        save_gnn(self._folder / POLICY, self._networks[decisions], config)


def _row_at(curve: Iterable[CurveRow], decisions: int) -> CurveRow:
    """Return the evaluation after this many decisions."""
    for row in curve:
        if row.decisions == decisions:
            return row
    raise LookupError(f"the curve has no evaluation after {decisions} decisions")
