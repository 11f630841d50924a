"""A rollout buffer for credits that silence does not earn."""

from collections.abc import Generator

import numpy as np
from stable_baselines3.common.buffers import DictRolloutBuffer
from stable_baselines3.common.type_aliases import DictRolloutBufferSamples

SILENT_SHARE = 0.1  # of the silent rows that are learned from


class ActiveRolloutBuffer(DictRolloutBuffer):
    """Yields the rows that transmitted, and a share of the silent ones.

    Without discount a robot's advantage is its credit, and a silent robot's is 0: its row adds
    nothing to the policy's gradient. So most of the rows, which cost as much as the others, can be
    left out; some stay for the entropy. Credits are not normalised, for their zero means something.

    What PPO logs of its passes (value, clipping, divergence) is over the rows kept, among which
    transmissions are more frequent than in the rollout. Values, which nothing reads without
    discount, are learned from these rows, too.
    """

    def compute_returns_and_advantage(self, last_values: object, dones: np.ndarray) -> None:
        """Advantages and returns are the rewards; what comes later is worth nothing."""
        del last_values, dones
        self.advantages[...] = self.rewards
        self.returns[...] = self.rewards

    def get(self, batch_size: int | None = None) -> Generator[DictRolloutBufferSamples, None, None]:
        """One pass over the rows kept, shuffled, in minibatches.

        Were no row left out, they would be of the given size; they become smaller in proportion.
        """
        num_rows = self.buffer_size * self.n_envs
        if not self.generator_ready:
            # Window by window, where they lie: most of them are never looked at.
            for name, rows in self.observations.items():
                self.observations[name] = rows.reshape(num_rows, *rows.shape[2:])
            for name in ("actions", "values", "log_probs", "advantages", "returns"):
                setattr(self, name, getattr(self, name).reshape(num_rows, 1))
            self.generator_ready = True
        is_active = self.actions[:, 0] != self.observations["owner"][:, 0]
        is_kept = is_active | (np.random.random(num_rows) < SILENT_SHARE)  # noqa: NPY002 - as SB3
        kept = np.random.permutation(np.flatnonzero(is_kept))  # noqa: NPY002
        num_batches = max(1, round(num_rows / (batch_size or num_rows)))
        for rows in np.array_split(kept, num_batches):
            if len(rows):
                yield self._get_samples(rows)
