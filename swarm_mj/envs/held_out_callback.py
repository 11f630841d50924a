"""Evaluations while a model of stable-baselines3 learns, always on the same missions."""

import copy
import io
import math
import pickle
from pathlib import Path

from stable_baselines3.common.callbacks import BaseCallback

from swarm_mj.envs.flown_model import Flown, missions_of
from swarm_mj.mission import Mission
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.writing import write_bytes


class HeldOutCallback(BaseCallback):
    """A callback that flies the same missions again and again, and keeps the best model.

    It logs `eval/aoi_mean`, the age of information [windows], mean over missions and windows,
    whatever reward the model learns from. Robots draw their recipients, as in training. It draws
    nothing from the training's generators, so that a model learns the same without it.

    The model is evaluated before it learns, every `every` timesteps, and at the end.

    Attributes:
        aoi_mean: The age at the last evaluation [windows]; nan before the first.
        best_aoi_mean: The least age so far [windows]; infinite before the first.

    Example:
        >>> callback = HeldOutCallback(best_path="runs/best.zip")
        >>> model.learn(100_000, callback=callback)
        >>> policy = Flown(PPO.load("runs/best.zip"), paper("flocking", num_robots=10))
    """

    def __init__(
        self,
        mission: Mission | None = None,
        *,
        num_missions: int = 20,
        seed: int = 3000,
        every: int = 20_000,
        best_path: Path | str | None = None,
        features: str | None = None,
        is_deterministic: bool = False,
    ) -> None:
        """Take the missions, and what is kept.

        Args:
            mission: What is flown; None is the mission of the model's environment, which
                then gives its components, too.
            num_missions: Missions of each evaluation.
            seed: Of the first one; the others count on from it. Those that training flies are no
                measure.
            every: Timesteps between evaluations, counted as `learn` counts them: a window of one
                robot each.
            best_path: The file of the best model, which is replaced; `.zip` is appended unless it
                ends so. Beside it, with the ending `.pkl`, stand the averages of `VecNormalize`,
                if the model has it. None keeps no model.
            features: As of `Flown`.
            is_deterministic: Whether robots take the most probable recipient, not a draw. It is
                often silence for all.

        Raises:
            ValueError: If a number is below 1. When training begins, it raises what `Flown` and
                `Swarm` raise.
        """
        super().__init__()
        for name, number in {"num_missions": num_missions, "every": every}.items():
            if number < 1:
                raise ValueError(f"{name} must be 1 or more, not {number}")
        self._mission = mission
        self._seeds = range(seed, seed + num_missions)
        self._every = every
        self._best_path = None
        if best_path is not None:
            path = Path(best_path)
            self._best_path = path if path.suffix == ".zip" else Path(f"{path}.zip")
        self._features = features
        self._is_deterministic = is_deterministic
        self._swarm: Swarm | None = None
        self._evaluated_at = -1  # timesteps; none yet
        self.aoi_mean = math.nan
        self.best_aoi_mean = math.inf

    def _init_callback(self) -> None:
        """Make the policy and the missions before training begins, so that mistakes show then."""
        self._policy = Flown(
            self.model,
            self._mission,
            features=self._features,
            is_deterministic=self._is_deterministic,
        )
        batch = missions_of(self.model)
        # Copies: parts of a user's own may remember, and training flies the same ones.
        components = Components() if batch is None else copy.deepcopy(batch.components)
        self._swarm = Swarm(self._policy.mission, self._seeds, **components.given)

    def _on_rollout_start(self) -> None:
        """Evaluate when due: here, since policies change between rollouts only."""
        if self.num_timesteps // self._every != self._evaluated_at // self._every:
            self._evaluate()

    def _on_step(self) -> bool:
        """Let training go on."""
        return True

    def _on_training_end(self) -> None:
        if self.num_timesteps != self._evaluated_at:
            self._evaluate()

    def _evaluate(self) -> None:
        """Fly the missions, log their age, and keep the model if it is the best so far."""
        assert self._swarm is not None
        self._swarm.restart(self._seeds)
        self.aoi_mean = float(summarise(rollout(self._swarm, self._policy)).aoi_mean.mean())
        self._evaluated_at = self.num_timesteps
        # In a line of its own: the log's next one may come after the policy has changed.
        self.logger.record("time/total_timesteps", self.num_timesteps, exclude="tensorboard")
        self.logger.record("eval/aoi_mean", self.aoi_mean)
        self.logger.dump(self.num_timesteps)
        if self.aoi_mean < self.best_aoi_mean:
            self.best_aoi_mean = self.aoi_mean
            self._keep()

    def _keep(self) -> None:
        """Write the model, and its averages if it has any."""
        if self._best_path is None:
            return
        stored = io.BytesIO()
        self.model.save(stored)
        averages = self.model.get_vec_normalize_env()
        with deferred_interrupt() as is_interrupted:  # the two files belong together
            write_bytes(self._best_path, stored.getvalue())
            if averages is not None:
                write_bytes(self._best_path.with_suffix(".pkl"), pickle.dumps(averages))
        if is_interrupted():
            raise KeyboardInterrupt
