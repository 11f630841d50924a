"""Arm `robot` on 40 stationary robots: three seeds, and what whose-turn-it-is is worth.

    python training/robot_arm.py

Leaves runs/robot-40-*, their curves and an evaluation on 100 unseen missions under
training/results/learning.
"""

import sys
from dataclasses import dataclass

from learning import evaluate, run, train


@dataclass(frozen=True, kw_only=True)
class RobotArm:
    """The settings; the rest is arm `robot`'s own."""

    seeds: tuple[int, ...] = (0, 1, 2)
    minutes: float = 6.0  # per seed, one core
    local_seeds: tuple[int, ...] = (0,)  # of the features that know nothing of turns
    local_minutes: float = 9.0
    episodes: int = 100

    def __call__(self) -> None:
        """Trains all, then evaluates all, beside the hand-written policies."""
        policies = [
            train(
                f"robot-40-{features}-seed{seed}",
                f"--arm robot --task stationary --robots 40 --features {features} --seed {seed} "
                f"--minutes {minutes:g} --evaluate-every 5000".split(),
            )
            for features, seeds, minutes in (
                ("extended", self.seeds, self.minutes),
                ("local", self.local_seeds, self.local_minutes),
            )
            for seed in seeds
        ]
        evaluate(
            "robot-40",
            ["tdma", "spatial-tdma", "mst", *policies],
            f"--task stationary --robots 40 --episodes {self.episodes} --jobs 2".split(),
        )


if __name__ == "__main__":
    sys.exit(run(RobotArm()))
