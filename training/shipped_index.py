"""The numbers of `index-csma` that come with the package, found anew.

    python training/shipped_index.py

Searches them by evolution on a mix of missions, for 20 minutes or as many as are asked for, and
goes on with a search that has begun. The numbers of the policy that is kept, with the seed, the
budget and the commit that found them, are written to `swarm_mj/policies/index/shipped.toml`.
"""

import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from swarm_mj.cli import script
from swarm_mj.cli.train_report import Watch
from swarm_mj.learning.run_folder import SETTINGS, Limits, TrainingRun
from swarm_mj.learning.settings import Training
from swarm_mj.learning.train import train
from swarm_mj.mission.presets import paper, urban
from swarm_mj.policies.index.shipped import SHIPPED
from swarm_mj.policies.index.weights import by_name, from_tensors
from swarm_mj.policies.stored import POLICY, read_weights
from swarm_mj.system.exit_codes import DONE, INTERRUPTED
from swarm_mj.system.fields import setting
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.writing import Output, check_outputs, write_text

ROOT = Path(__file__).resolve().parent.parent
COMMAND = "python training/shipped_index.py"
# What is not among them drifts: a search without range ratio 1, large teams or the city was worse
# there than before it. Each generation flies ten of them.
MISSIONS = (
    paper("stationary", num_robots=40),
    paper("random-walk", num_robots=40),
    paper("flocking", num_robots=40),
    paper("stationary", num_robots=3),
    paper("stationary", num_robots=6, range_ratio=0.5),
    paper("stationary", num_robots=20, range_ratio=0.5),
    paper("stationary", num_robots=40, range_ratio=0.2),
    paper("stationary", num_robots=40, range_ratio=0.35),
    paper("stationary", num_robots=40, range_ratio=1.0),
    paper("stationary", num_robots=100, range_ratio=0.25),
    paper("stationary", num_robots=20, arena="blocks"),
    paper("stationary", num_robots=40, arena="blocks"),
    paper("random-walk", num_robots=10),
    paper("random-walk", num_robots=20),
    paper("random-walk", num_robots=80),
    paper("random-walk", num_robots=200),
    paper("random-walk", num_robots=20, arena="blocks"),
    paper("random-walk", num_robots=40, position_noise_m=20.0),
    paper("random-walk", num_robots=40, bit_rate=30_000.0),
    paper("stationary", num_robots=40, erasure=0.2),
    paper("stationary", num_robots=30, fading="rayleigh"),
    paper("flocking", num_robots=20, velocity_ratio=0.3),
    paper("flocking", num_robots=60),
    urban("random-walk", num_robots=40),
    urban("flocking", num_robots=30),
)
TRAINING = Training(
    policy="index-csma",
    mission=MISSIONS[0],
    other_missions=MISSIONS[1:],
    robots=(),
    missions=10,
    train_windows=(150, 250),
    evaluate_every=500_000,
    held_out=3,
    seed=1,
)


@dataclass(frozen=True, kw_only=True)
class ShippedIndex:
    """How long to search, and where everything goes."""

    minutes: float = setting(20.0, "of the search", low=0.01, high=10_000.0)
    run: Path = setting(
        ROOT / "runs" / "index",
        "where the search is kept, to go on with",
        metavar="DIR",
        shown="runs/index",
    )
    out: Path = setting(
        SHIPPED,
        "where the numbers go",
        metavar="FILE.toml",
        shown="swarm_mj/policies/index/shipped.toml",
    )

    def __call__(self) -> int:
        """Search, then write the numbers; return the exit code."""
        check_outputs(Output("numbers", self.out, ".toml"))
        limits = Limits(minutes=self.minutes)
        command = f"{COMMAND} --minutes {self.minutes:g}"
        asked = TrainingRun(training=TRAINING, limits=limits, command=command)
        console = Console(stderr=True, highlight=False, soft_wrap=True)
        has_begun = (self.run / SETTINGS).exists()
        with deferred_interrupt() as is_interrupted:
            watch = Watch(console, asked, is_interrupted)
            with watch:
                train(asked, self.run, listener=watch, is_resumed=has_begun)
        if watch.has_stopped:
            return INTERRUPTED
        write_text(self.out, shipped_text(self.run / POLICY))
        return DONE


def shipped_text(policy: Path) -> str:
    """Return the file of a policy's numbers, and of how they were found."""
    tensors, config = read_weights(policy)
    made: dict[str, Any] = {
        "command": config.training["command"],
        "seed": config.training["seed"],
        "decisions": config.training["decisions"],
        "minutes": round(config.training["minutes"], 1),
        "commit": config.commit or "unknown",
    }
    lines = [f"# The numbers of index-csma, as `{COMMAND}` found them.", "", "[made]"]
    for name, value in made.items():
        lines.append(f"{name} = {_toml(value)}")
    groups: list[str] = ["", "[weights]"]
    features: list[str] = []
    for name, value in by_name(from_tensors(tensors)).items():
        if isinstance(value, dict):
            features += ["", f"[weights.{name}]"]
            for feature, number in value.items():
                features.append(f"{feature} = {_toml(number)}")
        else:
            groups.append(f"{name} = {_toml(value)}")
    text = "\n".join([*lines, *groups, *features]) + "\n"
    tomllib.loads(text)  # what cannot be read is not written
    return text


def _toml(value: object) -> str:
    """Return a number to five digits, a list of such, or a text, as TOML has it."""
    if isinstance(value, float):
        return repr(float(f"{value:.5g}"))
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else str(value)


if __name__ == "__main__":
    sys.exit(script(ShippedIndex, ShippedIndex.__call__))
