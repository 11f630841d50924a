"""Credit per robot on 40 stationary robots: three seeds, and what whose-turn-it-is is worth.

    python training/robot_arm.py

Leaves runs/robot-40-*, their curves and an evaluation on 100 unseen missions under
training/results/learning.
"""

import sys
from dataclasses import dataclass

from learning import Experiment, run

from swarm_mj.fields import setting


@dataclass(frozen=True, kw_only=True)
class RobotArm(Experiment):
    """The settings; the rest is the usual of credit per robot."""

    seeds: tuple[int, ...] = setting((0, 1, 2), "of the runs with turns")
    minutes: float = setting(6.0, "of each of these, on one core", low=0.01, high=10_000.0)
    local_seeds: tuple[int, ...] = setting((0,), "of the runs whose features know of no turns")
    local_minutes: float = setting(9.0, "of each of these", low=0.01, high=10_000.0)

    def __call__(self) -> None:
        """Trains all, then evaluates all, beside the hand-written policies."""
        missions = "--task stationary --robots 40"
        policies = [
            self.train(
                f"robot-40-{features}-seed{seed}",
                f"--arm robot {missions} --features {features} --seed {seed} "
                f"--minutes {minutes:g} --evaluate-every 5000",
            )
            for features, seeds, minutes in (
                ("extended", self.seeds, self.minutes),
                ("local", self.local_seeds, self.local_minutes),
            )
            for seed in seeds
        ]
        self.evaluate("robot-40", ["tdma", "spatial-tdma", "mst", *policies], missions)


if __name__ == "__main__":
    sys.exit(run(RobotArm))
