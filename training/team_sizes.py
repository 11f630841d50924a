"""A policy trained on 20 robots, flown with 10, 20, 40 and 80.

python training/team_sizes.py
"""

import sys
from dataclasses import dataclass

from learning import evaluate, run, train


@dataclass(frozen=True, kw_only=True)
class TeamSizes:
    """The settings; the rest is arm `robot`'s own."""

    trained_on: int = 20
    flown_with: tuple[int, ...] = (10, 20, 40, 80)
    seed: int = 0
    minutes: float = 4.0
    episodes: int = 100

    def __call__(self) -> None:
        """Trains on one size, then evaluates on all."""
        policy = train(
            f"robot-{self.trained_on}-seed{self.seed}",
            f"--arm robot --task stationary --robots {self.trained_on} --seed {self.seed} "
            f"--minutes {self.minutes:g}".split(),
        )
        evaluate(
            f"trained-on-{self.trained_on}",
            [policy, "tdma", "spatial-tdma"],
            [
                *f"--task stationary --episodes {self.episodes} --jobs 2 --robots".split(),
                *map(str, self.flown_with),
            ],
        )


if __name__ == "__main__":
    sys.exit(run(TeamSizes()))
