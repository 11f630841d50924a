"""Both arms under the `reference` preset on 10 stationary robots, on one axis of team decisions.

    python training/both_arms.py

Arm `team` has the authors' settings: their features, edges, network and PPO. At 40 robots it makes
a few decisions a second on a CPU, so the comparison is made where it can get somewhere. Arm `robot`
is flown with its own features, and with the authors' seven, which know of no turns.
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
    robot_minutes: float = 4.0
    episodes: int = 100

    def __call__(self) -> None:
        """Trains both, then evaluates both."""
        missions = f"--preset reference --task stationary --robots {self.num_robots}"
        runs = (
            ("robot", f"--arm robot --minutes {self.robot_minutes:g}"),
            ("robot-seven", f"--arm robot --features reference --minutes {self.robot_minutes:g}"),
            ("team", f"--arm team --minutes {self.team_minutes:g}"),
        )
        policies = [
            train(
                f"{name}-{self.num_robots}-reference-seed{self.seed}",
                f"{options} {missions} --seed {self.seed}".split(),
            )
            for name, options in runs
        ]
        evaluate(
            f"both-arms-{self.num_robots}",
            [*policies, "tdma", "mst", "round-robin"],
            f"{missions} --episodes {self.episodes} --jobs 2".split(),
        )


if __name__ == "__main__":
    sys.exit(run(BothArms()))
