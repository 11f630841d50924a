"""Where a run stands, beside PPO's own state: its time, its learning curve, its running totals."""

import csv
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

from swarm_mj.io.atomic_file import atomic_write
from swarm_mj.learning.env import MissionsEnv


@dataclass(kw_only=True)
class Tally:
    """What the missions in training cost since the last evaluation."""

    seconds: float = 0.0
    decisions: int = 0  # of teams
    age_windows: float = 0.0  # summed over the decisions
    attempted: int = 0  # packets
    delivered: int = 0

    def add(self, env: MissionsEnv) -> None:
        """Adds a window of all missions, but no time."""
        self.decisions += env.num_teams
        for outcome in env.outcomes:
            self.age_windows += float(outcome.age_windows.sum())
            self.attempted += int(outcome.attempted.sum())
            self.delivered += int(outcome.delivered.sum())

    def means(self) -> dict[str, float]:
        """Per mission and window; empty before the first."""
        if not self.decisions:
            return {}
        return {
            "rollout/aoi": self.age_windows / self.decisions,
            "rollout/packets_per_window": self.attempted / self.decisions,
            "rollout/delivery_ratio": self.delivered / max(1, self.attempted),
            "rollout/decisions_per_s": self.decisions / max(self.seconds, 1e-9),
        }


@dataclass(kw_only=True)
class Progress:
    """Where a run stands."""

    decisions: int = 0  # of teams, in all sessions
    minutes: float = 0.0  # in all sessions, evaluations included
    next_evaluation: int = 0  # team decisions
    next_replay: int = 0  # team decisions
    best_objective: float = float("inf")
    curve: list[dict[str, float]] = field(default_factory=list)  # one row an evaluation
    tally: Tally = field(default_factory=Tally)
    optimiser: dict[str, float] = field(default_factory=dict)  # what PPO last logged of itself

    @property
    def best(self) -> dict[str, float] | None:
        """The evaluation of the policy that is kept."""
        return min(self.curve, key=lambda row: row["objective"], default=None)

    def to_json(self) -> str:
        """All of it; `from_json` gives every number back as it was."""
        return json.dumps(asdict(self))


def from_json(text: str) -> Progress:
    """What `Progress.to_json` wrote.

    Raises:
        ValueError: It is no JSON.
        TypeError: A key is unknown.
    """
    content = json.loads(text)
    return Progress(**{**content, "tally": Tally(**content["tally"])})


def write_curve(path: Path, curve: list[dict[str, float]]) -> None:
    """Writes a learning curve, one row an evaluation.

    Args:
        path: The CSV file.
        curve: Rows by name; the later ones may have names that the first lacks.

    Raises:
        OSError: The file cannot be written.
    """
    names = list(dict.fromkeys(name for row in curve for name in row))
    with atomic_write(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(curve)
