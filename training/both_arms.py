"""Both arms under the `reference` preset on 10 stationary robots, on one axis of team decisions.

    python training/both_arms.py

Arm `team` has the authors' settings: their features, edges, network and PPO. At 40 robots it makes
a few decisions a second on a CPU, so the comparison is made where it can get somewhere.
"""

import sys
from dataclasses import dataclass

from learning import evaluate, run, train


@dataclass(frozen=True, kw_only=True)
class BothArms:
    """The settings; the rest is each arm's own."""

    num_robots: int = 10
    seed: int = 0
    team_minutes: float = 40.0
    robot_minutes: float = 6.0
    episodes: int = 100

    def __call__(self) -> None:
        """Trains both, then evaluates both."""
        missions = f"--preset reference --task stationary --robots {self.num_robots}"
        policies = [
            train(
                f"{arm}-{self.num_robots}-reference-seed{self.seed}",
                f"--arm {arm} {missions} --seed {self.seed} --minutes {minutes:g}".split(),
            )
            for arm, minutes in (("robot", self.robot_minutes), ("team", self.team_minutes))
        ]
        evaluate(
            f"both-arms-{self.num_robots}",
            [*policies, "tdma", "mst", "round-robin"],
            f"{missions} --episodes {self.episodes} --jobs 2".split(),
        )


if __name__ == "__main__":
    sys.exit(run(BothArms()))
