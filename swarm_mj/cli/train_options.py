"""The options of `swarm-mj train`, and where in a run's settings they stand."""

import argparse
from pathlib import Path
from typing import Any, get_args

from swarm_mj.cli.options import DEFAULTS, listed
from swarm_mj.graphs.graph import FeatureSet
from swarm_mj.mission import PRESETS, Boundary, Task

BUDGETS = {"robot": 200_000, "team": 2_000_000}  # team decisions; the paper's for the paper's arm
# Where an option stands in the settings, and what it is unless given: in arm robot, in arm team.
PLACES: dict[str, tuple[str, object, object]] = {
    "arm": ("arm", "robot", "team"),
    "seed": ("seed", 0, 0),
    "features": ("features", "extended", None),
    "receptive_field": ("network.receptive_field", 1, 5),
    "latent": ("network.latent", 32, 64),
    "depth": ("network.depth", 2, 3),
    "edges": ("network.edges", "both", None),
    "linear": ("network.is_linear", False, False),
    "reward": ("reward", "aoi", "aoi"),
    "missions": ("missions", 16, 32),
    "learning_rate": ("ppo.learning_rate", 0.001, 0.0001),
    "entropy": ("ppo.entropy", 0.003, 1e-6),
    "discount": ("ppo.discount", 0.0, 0.99),
    "threads": ("threads", 1, 1),
    "evaluate_every": ("evaluate_every", 10_000, 10_000),
    "held_out": ("held_out", 12, 12),
    "task": ("mission.task", "stationary", "stationary"),
    "preset": ("mission.preset", "paper", "paper"),
    "robots": ("robots", (DEFAULTS.num_robots,), (DEFAULTS.num_robots,)),
    "range_ratio": ("mission.range_ratio", DEFAULTS.range_ratio, DEFAULTS.range_ratio),
    "velocity_ratio": ("mission.velocity_ratio", DEFAULTS.velocity_ratio, DEFAULTS.velocity_ratio),
    "windows": ("mission.num_windows", DEFAULTS.num_windows, DEFAULTS.num_windows),
    "boundary": ("mission.boundary", None, None),
}  # None: the preset's own


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds them; what is unset means the arm's own, or in a resumed run the run's own."""
    parser.add_argument("--out", type=Path, required=True, metavar="runs/NAME", help="the run")
    parser.add_argument("--resume", action="store_true", help="go on with the run in OUT")
    parser.add_argument(
        "--budget",
        type=int,
        metavar="DECISIONS",
        help="stop after so many decisions of teams, in all (default: 200000, team: 2000000; none "
        "with --minutes)",
    )
    parser.add_argument(
        "--minutes", type=float, help="stop after so long, in all, evaluations included"
    )
    _add_learning_options(parser.add_argument_group("learning"))
    _add_watching_options(parser.add_argument_group("watching"))
    _add_mission_options(parser.add_argument_group("missions"))


def _add_learning_options(group: Any) -> None:  # noqa: ANN401 - argparse names no public type
    _add(
        group,
        "--arm",
        str,
        "robot: every robot is paid its own credit, and learns in minutes; team: the paper's way",
    )
    _add(group, "--seed", int, "the same seed is the same policy")
    _add(group, "--features", str, listed(get_args(FeatureSet)))
    _add(group, "--receptive-field", int, "K, message passes")
    _add(group, "--latent", int, "width of every layer")
    _add(group, "--depth", int, "layers of every MLP")
    _add(group, "--edges", str, "who hears whom in the graph: paper, reference, both")
    group.add_argument("--linear", action="store_true", default=None, help="the linear variant")
    _add(group, "--reward", str, "aoi, or in arm team velocity-variance")
    _add(group, "--missions", int, "flown side by side")
    group.add_argument("--init", type=Path, metavar="POLICY", help="begin with a stored policy")
    _add(group, "--learning-rate", float, "of Adam, at the start")
    _add(group, "--entropy", float, "weight of the entropy bonus")
    _add(group, "--discount", float, "gamma")
    _add(group, "--threads", int, "torch's")


def _add_watching_options(group: Any) -> None:  # noqa: ANN401 - argparse names no public type
    _add(group, "--evaluate-every", int, "decisions of teams between two evaluations")
    _add(group, "--held-out", int, "missions of an evaluation, of each team size")
    group.add_argument(
        "--replay-every",
        type=int,
        metavar="DECISIONS",
        help="record the first held-out mission in OUT/replays whenever so many are made",
    )


def _add_mission_options(group: Any) -> None:  # noqa: ANN401 - argparse names no public type
    _add(group, "--task", str, listed(get_args(Task)))
    _add(group, "--preset", str, listed(PRESETS))
    _add(group, "--robots", int, "size of the team; several are trained on together", nargs="+")
    _add(group, "--range-ratio", float, "of a packet in silence, as a share of 1 km")
    _add(group, "--velocity-ratio", float, "as for fly")
    _add(group, "--windows", int, "length of a mission")
    _add(group, "--boundary", str, listed(get_args(Boundary)))


def _add(group: Any, flag: str, kind: type, text: str, nargs: str | None = None) -> None:  # noqa: ANN401 - as above
    """An option that is unset by default; its help tells what that means."""
    _, robot, team = PLACES[option_name(flag)]
    default = shown(robot)
    if team != robot and flag != "--arm":
        default += f", team: {shown(team)}"
    group.add_argument(flag, type=kind, nargs=nargs, help=f"{text} (default: {default})")


def shown(value: object) -> str:
    """A setting's value as it is typed."""
    if isinstance(value, tuple):
        return " ".join(map(str, value))
    return "the preset's own" if value is None else str(value)


def option_name(flag: str) -> str:
    """The attribute of an option, by its flag."""
    return flag.removeprefix("--").replace("-", "_")


def option_flag(name: str) -> str:
    """The flag of an option, by its attribute."""
    return "--" + name.replace("_", "-")
