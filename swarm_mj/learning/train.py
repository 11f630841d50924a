"""The training run (III-C), from an empty folder or a checkpoint to a policy; PPO's session."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from swarm_mj.learning import checkpoint, run_folder
from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.held_out import Acting
from swarm_mj.learning.index_session import IndexSession
from swarm_mj.learning.live import LiveTraining
from swarm_mj.learning.loggers import Guarded, Logger
from swarm_mj.learning.ppo import make_model, mean_entropy, networks_of
from swarm_mj.learning.run_folder import CHECKPOINT, INIT, SETTINGS, TrainingRun
from swarm_mj.learning.selection import Listener, Progress
from swarm_mj.learning.session import Session, record_evaluation
from swarm_mj.learning.ways import TrainedPolicy
from swarm_mj.policies.gnn.network import Network
from swarm_mj.policies.policy_config import GnnConfig
from swarm_mj.policies.stored import read_policy, save_gnn
from swarm_mj.system.writing import owned

# What PPO logs of itself, by its names.
OPTIMISER = [
    f"train/{name}"
    for name in ("entropy", "explained_variance", "approx_kl", "clip_fraction", "value_loss")
]


class TrainingSession(Session, BaseCallback):
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
        BaseCallback.__init__(self)
        Session.__init__(self, run, folder, listener, logger, live)
        self.ppo = make_model(run.training, run.device)
        self._env = env_of(self.ppo)
        kept = folder / CHECKPOINT
        own = folder / INIT
        init = None
        # Nothing is written before all that is read has been checked.
        if kept.exists():
            self.progress, networks = checkpoint.load(kept, run.training, self.ppo)
            self._kept.update(networks)
        elif run.init is not None:
            path = own if own.exists() else run.init
            init = read_policy(path)
            _, config = init
            stored = (config.network, config.own_network)
            if stored != (run.training.network, run.training.own_network):
                whose = "the run that begins with it"
                raise ValueError(f"policy {path} has another network than {whose}")
        self._begin()
        if init is not None:
            network, config = init
            networks_of(self.ppo).take_acting_network(network)
            if not own.exists():
                save_gnn(own, network, config)
        self.ppo.set_logger(configure(str(folder / run_folder.TENSORBOARD), ["tensorboard"]))

    def learn(self) -> None:
        """Alternate rollouts and passes over them until a limit or the listener ends it (III-C)."""
        model = self.ppo
        model._setup_learn(0, self, reset_num_timesteps=model.num_timesteps == 0)
        super().learn()

    def _take_step(self) -> None:
        # PPO's own loop knows no minutes and no stall, and would dump its logs by itself.
        model = self.ppo
        env = model.get_env()
        assert env is not None
        model.collect_rollouts(env, self, model.rollout_buffer, model.n_steps)
        model.train()

    def _on_step(self) -> bool:
        costs = self._env.costs
        progress = self.progress
        progress.since_evaluation.add(costs)
        progress.decisions += self._env.num_teams
        self._aoi = float(np.mean([each.age_windows.mean() for each in costs]))
        self._report()
        return True

    def _on_rollout_end(self) -> None:
        # PPO's own mean is over the rows it learns from.
        self.logger.record("train/entropy", mean_entropy(self.ppo))

    def _between_steps(self, *, is_last: bool) -> None:
        """Check the weights, then do what is due."""
        progress = self.progress
        # The last checkpoint was written before the rollout that broke the weights.
        if not all(torch.isfinite(weight).all() for weight in self.ppo.policy.parameters()):
            raise ValueError(
                f"the network's weights are no longer finite after {progress.decisions} decisions; "
                "begin a new run with a lower learning rate"
            )
        logged = self.logger.name_to_value
        means = {name: float(logged[name]) for name in OPTIMISER if name in logged}
        progress.optimiser = means or progress.optimiser  # of PPO's last passes over a rollout
        super()._between_steps(is_last=is_last)

    def close(self) -> None:
        """Close TensorBoard's file."""
        self.ppo.logger.close()

    def _acting(self) -> Network:
        return networks_of(self.ppo).acting_network()

    def _write_checkpoint(self) -> None:
        networks = {at: net for at, net in self._kept.items() if isinstance(net, Network)}
        path = self._folder / CHECKPOINT
        checkpoint.save(path, self._training, self.ppo, self.progress, networks)

    def _store(self, path: Path, acting: Acting, origin: dict[str, Any]) -> None:
        assert isinstance(acting, Network)
        training = self._training
        config = GnnConfig(
            network=training.network,
            features=training.features,
            silence_logit=training.silence_logit,
            most_speech=training.most_speech,
            own_network=training.own_network,
            **origin,
        )
        save_gnn(path, acting, config)

    def _record(self, columns: dict[str, float], decisions: int) -> None:
        record_evaluation(self.logger, columns, decisions)


SESSIONS: dict[TrainedPolicy, type[Session]] = {"gnn": TrainingSession, "index-csma": IndexSession}


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
        kind = SESSIONS[run.training.policy]
        session = kind(run, folder, listener, guarded, shown)
        guarded.do(lambda logger: logger.start(asdict(run), folder))
        try:
            session.learn()
            session.choose()
        finally:
            session.close()
            guarded.do(lambda logger: logger.finish())
    return session.progress
