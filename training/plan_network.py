"""Trains the network of policy `gnn`: what news is worth to the planner's schedules.

    python training/plan_network.py --minutes 30

Leaves runs/plan_network/policy, which `swarm-mj fly` and `evaluate` take as a policy, and
training/results/learning/plan-network-curve.csv. It is interrupted and continued at will: started
again, it goes on until the training has had its minutes.
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from swarm_mj.learning.plan_training import PlanTraining
from swarm_mj.policies.stored_scorer import save_scorer
from swarm_mj.provenance import commit, version

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "runs" / "plan_network"
CURVE = ROOT / "training" / "results" / "learning" / "plan-network-curve.csv"
COLUMNS = ("minutes", "generation", "candidates", "held_out", "step_size")
CARD = """# The network of policy `gnn`

Every robot evaluates this network on its picture of the team, and the planner of swarm_mj
(`swarm_mj/policies/planner.py`) weighs news by the result: trained weights decide inside a plan who
speaks when. Packets carry the planner's pictures beyond T, M and P.

- network: one message pass, {size} weights (`swarm_mj/policies/worth_network.py`)
- training: `{command}`, imitation of a rule, then CMA-ES on plans flown on paper
  (`swarm_mj/learning/plan_practice.py`); these weights are of generation {generations}, of 24
  candidates each, after {minutes:.1f} minutes on one core
- seed: {seed}; commit: {commit}; swarm_mj {version}
- age of information of its plans over that of the rule's, on teams that were never trained on but
  by which the generation was chosen: {held_out:.3f}
- what it costs on missions never seen, beside all other policies and with its weights shuffled:
  `training/RESULTS.md`, `training/results/` and the README

Licence: Apache-2.0, as swarm_mj.
"""


def train(minutes: float, seed: int, step_size: float) -> None:
    """Trains until the training has had its minutes; the best measured weights are kept."""
    curve = OUT / "curve.csv"
    OUT.mkdir(parents=True, exist_ok=True)
    rows = _rows(curve)
    spent = float(rows[-1]["minutes"]) if rows else 0.0
    best = min([float(row["held_out"]) for row in rows if row["held_out"] != "nan"] + [np.inf])
    training = PlanTraining(OUT / "evolution.npz", seed=seed, step_size=step_size)
    start = time.monotonic() - 60.0 * spent
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("begins", total=minutes)
        bar.update(task, completed=spent)
        for now in training.generations() if spent < minutes else ():
            spent = (time.monotonic() - start) / 60.0
            if now.held_out < best:  # before the curve says so, or a kill between would lose it
                best = now.held_out
                _save(training, seed, minutes, spent, now.generation, best)
            _append(curve, (f"{spent:.2f}", now.generation, *_shown(now)))
            described = f"generation {now.generation}, best {best:.3f} of the rule's age"
            bar.update(task, completed=spent, description=described)
            if spent >= minutes:
                break
    if curve.exists():
        CURVE.parent.mkdir(parents=True, exist_ok=True)
        CURVE.write_text(curve.read_text())


def _shown(now: object) -> list[str]:
    return [f"{getattr(now, name):.5f}" for name in COLUMNS[2:]]


def _save(
    training: PlanTraining,
    seed: int,
    budget: float,
    minutes: float,
    generations: int,
    held_out: float,
) -> None:
    parameters = training.mean
    facts = {
        "command": f"python training/plan_network.py --minutes {budget:g} --seed {seed}",
        "seed": seed,
        "minutes": round(minutes, 1),
        "generations": generations,
        "held_out": held_out,
        "commit": commit(),
        "version": version(),
    }
    size = sum(array.size for array in parameters.values())
    save_scorer(OUT / "policy", parameters, facts, CARD.format(size=size, **facts))


def _rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def _append(path: Path, row: tuple[object, ...]) -> None:
    is_new = not path.exists()
    with path.open("a", newline="") as file:
        csv.writer(file).writerows([COLUMNS, row] if is_new else [row])


def main() -> int:
    """Runs the training; returns its exit code."""
    parser = argparse.ArgumentParser(description="Train the network of policy gnn.")
    parser.add_argument("--minutes", type=float, default=30.0, help="of training (default: 30)")
    parser.add_argument("--seed", type=int, default=1, help="of the training (default: 1)")
    parser.add_argument("--step-size", type=float, default=0.015, help="the first (default: 0.015)")
    options = parser.parse_args()
    if not (options.minutes > 0.0 and options.seed >= 0 and options.step_size > 0.0):
        parser.error("--minutes and --step-size must be above 0, and --seed from 0")
    try:
        train(options.minutes, options.seed, options.step_size)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("interrupted; start it again to go on\n")
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
