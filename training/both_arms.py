"""Both credit assignments on 10 stationary robots, preset `reference`, by team decisions.

    python training/both_arms.py

Per team, training has the authors' settings: their features, edges, network and PPO. At 40 robots
it makes a few decisions a second on a CPU, so the comparison is made where it can get somewhere.
Per robot, it is run with features of its own, and with the authors' seven, which know of no turns.
"""

import sys
from dataclasses import dataclass

from learning import Experiment, run

from swarm_mj.fields import setting


@dataclass(frozen=True, kw_only=True)
class BothArms(Experiment):
    """The settings; the rest is each credit assignment's own."""

    num_robots: int = setting(10, "size of the team", low=2, high=200)
    seed: int = setting(0, "of the training")
    team_minutes: float = setting(40.0, "of training per team", low=0.01, high=10_000.0)
    robot_minutes: float = setting(4.0, "of each training per robot", low=0.01, high=10_000.0)

    def __call__(self) -> None:
        """Trains with each, then evaluates all."""
        missions = f"--preset reference --task stationary --robots {self.num_robots}"
        runs = (
            ("robot", f"--arm robot --minutes {self.robot_minutes:g}"),
            ("robot-seven", f"--arm robot --features reference --minutes {self.robot_minutes:g}"),
            ("team", f"--arm team --minutes {self.team_minutes:g}"),
        )
        policies = [
            self.train(
                f"{name}-{self.num_robots}-reference-seed{self.seed}",
                f"{options} {missions} --seed {self.seed}",
            )
            for name, options in runs
        ]
        baselines = ("tdma", "mst", "round-robin")
        self.evaluate(f"both-arms-{self.num_robots}", [*policies, *baselines], missions)


if __name__ == "__main__":
    sys.exit(run(BothArms))
