"""The options of `swarm-mj train`, and where in a run's settings they stand."""

import argparse
from functools import reduce
from pathlib import Path
from typing import Any, get_args

from swarm_mj.cli.options import listed
from swarm_mj.gnn.graphs import FeatureSet
from swarm_mj.mission import PRESETS, Boundary, Task

BUDGETS = {"robot": 200_000, "team": 2_000_000}  # team decisions; the paper's for the paper's arm
# Where an option stands in the settings; unless given, it is the arm's own.
PLACES = {
    "arm": "arm",
    "seed": "seed",
    "features": "features",
    "receptive_field": "network.receptive_field",
    "latent": "network.latent",
    "depth": "network.depth",
    "edges": "network.edges",
    "linear": "network.is_linear",
    "reward": "reward",
    "missions": "missions",
    "learning_rate": "ppo.learning_rate",
    "entropy": "ppo.entropy",
    "discount": "ppo.discount",
    "threads": "threads",
    "evaluate_every": "evaluate_every",
    "held_out": "held_out",
    "task": "mission.task",
    "preset": "mission.preset",
    "robots": "robots",
    "range_ratio": "mission.range_ratio",
    "velocity_ratio": "mission.velocity_ratio",
    "windows": "mission.num_windows",
    "boundary": "mission.boundary",
}


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
    action = group.add_argument(flag, type=kind, nargs=nargs)
    action.own = _ArmsOwn(option_name(flag))
    action.help = f"{text} (default: %(own)s)"


class _ArmsOwn:
    """The defaults of an option as text; looked up when they are shown, for it imports torch."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __str__(self) -> str:
        if self._name == "arm":
            return "robot"
        robot, team = (_own_default(arm, PLACES[self._name]) for arm in ("robot", "team"))
        return robot if robot == team else f"{robot}, team: {team}"


def _own_default(arm: str, place: str) -> str:
    from swarm_mj.learning.settings import arm_settings

    usual, other = (
        stored_value(arm_settings(arm, mission, (mission.num_robots,)), place)
        for mission in (PRESETS["paper"]("stationary"), PRESETS["reference"]("flocking"))
    )
    depends = usual != other and place not in ("mission.preset", "mission.task")
    return "the preset's own" if depends else shown(usual)


def stored_value(settings: object, place: str) -> object:
    """A value by its dotted place in a run's settings."""
    return reduce(getattr, place.split("."), settings)


def shown(value: object) -> str:
    """A setting's value as it is typed."""
    if isinstance(value, tuple):
        return " ".join(map(str, value))
    return str(value)


def option_name(flag: str) -> str:
    """The attribute of an option, by its flag."""
    return flag.removeprefix("--").replace("-", "_")


def option_flag(name: str) -> str:
    """The flag of an option, by its attribute."""
    return "--" + name.replace("_", "-")
