"""A policy trained on 20 robots, flown with 10, 20, 40 and 80.

python training/team_sizes.py
"""

import sys
from dataclasses import dataclass

from learning import Experiment, run

from swarm_mj.fields import setting


@dataclass(frozen=True, kw_only=True)
class TeamSizes(Experiment):
    """The settings; the rest is the usual of credit per robot."""

    trained_on: int = setting(20, "robots", low=2, high=200)
    flown_with: tuple[int, ...] = setting((10, 20, 40, 80), "robots", low=2, high=1000)
    seed: int = setting(0, "of the training")
    minutes: float = setting(4.0, "of training", low=0.01, high=10_000.0)

    def __call__(self) -> None:
        """Trains on one size, then evaluates on all."""
        policy = self.train(
            f"robot-{self.trained_on}-seed{self.seed}",
            f"--arm robot --task stationary --robots {self.trained_on} --seed {self.seed} "
            f"--minutes {self.minutes:g}",
        )
        sizes = " ".join(map(str, self.flown_with))
        self.evaluate(
            f"trained-on-{self.trained_on}",
            [policy, "tdma", "spatial-tdma"],
            f"--task stationary --robots {sizes}",
        )


if __name__ == "__main__":
    sys.exit(run(TeamSizes))
