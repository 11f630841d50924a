"""The training run (III-C): PPO's loop from an empty folder or a checkpoint to a stored policy."""

from pathlib import Path

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure

from swarm_mj.learning import checkpoint, run_folder
from swarm_mj.learning.actor_critic import GnnActorCritic
from swarm_mj.learning.callback import TrainingCallback
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.run_folder import CHECKPOINT, INIT, SETTINGS, Progress, TrainingRun
from swarm_mj.policies.stored import read_policy, save_policy
from swarm_mj.system.outputs import owned


def train(
    run: TrainingRun, folder: Path, *, listener: run_folder.Listener, is_resumed: bool = False
) -> Progress:
    """Train until a limit, or until the listener returns False; return where the run stands.

    The folder is made if it is not there. A resumed run goes on from its checkpoint, or starts over
    if it did not get that far. The listener gets a status after every window. The policy that a run
    begins with has the settings' network.

    Raises ValueError if the missions cannot be made, the folder is another's, the checkpoint is
    damaged or foreign, or training has diverged; OSError if the folder cannot be written.
    """
    check_folder = run_folder.check_begun if is_resumed else run_folder.check_new
    check_folder(folder)
    with owned(folder / SETTINGS):
        check_folder(folder)  # a run may have begun, or come further, meanwhile
        model, rng = make_model(run.training)
        progress, networks = _begun(folder, run, model, rng)
        model.set_logger(configure(str(folder / run_folder.TENSORBOARD), ["tensorboard"]))
        callback = TrainingCallback(model, run, folder, progress, networks, rng, listener)
        try:
            callback.learn()
            callback.choose()
        finally:
            model.logger.close()
    return progress


def _begun(
    folder: Path, run: TrainingRun, model: PPO, rng: np.random.Generator
) -> tuple[Progress, checkpoint.Networks]:
    """Take a run to its last checkpoint, or else to its beginning; then it can be resumed."""
    kept, own, progress, init = folder / CHECKPOINT, folder / INIT, Progress(), None
    networks: checkpoint.Networks = {}
    # Nothing is written before all that is read has been checked.
    if kept.exists():
        progress, networks = checkpoint.load(kept, run.training, model, rng)
    elif run.init is not None:
        path = own if own.exists() else run.init
        init = read_policy(path)
        if init[1].network != run.training.network:
            raise ValueError(f"policy {path} has another network than the run that begins with it")
    run_folder.write_run(folder, run)
    if progress.curve:
        progress.write_curve(folder)  # the file may be ahead of the checkpoint
    if init is not None:
        assert isinstance(model.policy, GnnActorCritic)
        model.policy.take_acting_network(init[0])
        if not own.exists():
            save_policy(own, *init)
    return progress, networks
