"""The options that make a study: who meets which missions."""

import argparse
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, get_args

from swarm_mj.cli.options import DEFAULTS, listed
from swarm_mj.evaluation.published import BASELINES
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import PRESETS, Boundary, Mission, PhysicsMode, Task
from swarm_mj.policies.registry import PAYLOADS, POLICIES, normalised, with_payload

DEFAULT_POLICIES = ("planner", *BASELINES)


def add_study_options(parser: argparse.ArgumentParser) -> None:
    """Adds them; those that sweep take several values."""
    _add_several(
        parser,
        "--policy",
        str,
        DEFAULT_POLICIES,
        f"who talks to whom: {listed(POLICIES)}, all of these, or directories of learned policies",
    )
    parser.add_argument(
        "--probability",
        type=float,
        default=None,
        help="of a transmission, for policies that have one (default: tuned)",
    )
    parser.add_argument(
        "--deterministic",
        action="store_true",
        help="learned policies take the most probable recipient instead of a draw",
    )
    parser.add_argument(
        "--payload",
        default=PAYLOADS[0],
        help=f"what the planner's packets carry beyond the buffers T, M and P: {listed(PAYLOADS)}",
    )
    parser.add_argument("--episodes", type=int, default=100, help="missions per regime")
    parser.add_argument(
        "--seed", type=int, default=1000, help="of the first mission; the others follow one by one"
    )
    parser.add_argument(
        "--baseline",
        metavar="POLICY",
        help="whom the others are compared to, mission by mission (default: the first policy)",
    )
    _add_regimes(parser)


def study_of(options: argparse.Namespace) -> Study:
    """The study that the options name.

    Raises:
        ValueError: A value is unknown or outside its range.
    """
    policies = _several(options, "--policy")
    if "all" in policies:
        policies = [name for name in [*policies, *POLICIES] if name != "all"]
    policies = list(dict.fromkeys(map(normalised, policies)))
    flown = dict(zip(policies, with_payload(policies, options.payload), strict=True))
    baseline = options.baseline and normalised(options.baseline)
    axes = ("--preset", "--task", "--robots", "--velocity-ratio", "--range-ratio", "--switched-off")
    regimes = product(*(_several(options, axis) for axis in axes))
    return Study(
        policies=tuple(dict.fromkeys(flown.values())),
        regimes=tuple(_mission(options, *regime) for regime in regimes),
        episodes=options.episodes,
        seed=options.seed,
        probability=options.probability,
        is_deterministic=options.deterministic,
        baseline=flown.get(baseline, baseline),
    )


def _mission(
    options: argparse.Namespace,
    preset: str,
    task: str,
    num_robots: int,
    velocity_ratio: float,
    range_ratio: float,
    switched_off: float,
) -> Mission:
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {listed(PRESETS)}, not {preset!r}")
    boundary = {} if options.boundary is None else {"boundary": options.boundary}
    return PRESETS[preset](
        task,
        num_robots=num_robots,
        velocity_ratio=velocity_ratio,
        range_ratio=range_ratio,
        switched_off=switched_off,
        num_windows=options.windows,
        physics=options.physics,
        **boundary,
    )


def _add_regimes(parser: argparse.ArgumentParser) -> None:
    """The options that make missions; each takes several values."""
    group = parser.add_argument_group("missions", "Several values sweep; sweeps multiply.")
    _add_several(
        group, "--task", str, ["flocking"], f"what the robots do: {listed(get_args(Task))}"
    )
    _add_several(
        group,
        "--preset",
        str,
        ["paper"],
        f"{listed(PRESETS)}: the paper's text, or its authors' code",
    )
    _add_several(group, "--robots", int, [DEFAULTS.num_robots], "size of the team, 2 to 1000")
    _add_several(
        group, "--velocity-ratio", float, [DEFAULTS.velocity_ratio], "as for fly, 0.001 to 5"
    )
    _add_several(group, "--range-ratio", float, [DEFAULTS.range_ratio], "as for fly, 0.01 to 10")
    _add_several(group, "--switched-off", float, [DEFAULTS.switched_off], "as for fly, 0 to 0.9")
    group.add_argument(
        "--windows", type=int, default=DEFAULTS.num_windows, help="length, 1 to 100000"
    )
    group.add_argument("--physics", default=DEFAULTS.physics, help=listed(get_args(PhysicsMode)))
    group.add_argument(
        "--boundary",
        help=f"{listed(get_args(Boundary))} (default: the paper's, none for flocks)",
    )


def _add_several(
    parser: Any,  # noqa: ANN401 - a parser or a group of one
    flag: str,
    kind: Callable[[str], Any],
    default: Sequence[Any],
    what: str,
) -> None:
    """An option of several values, after one flag or several."""
    parser.add_argument(
        flag,
        type=kind,
        action="extend",
        nargs="+",
        metavar=kind.__name__.upper() if kind is not str else "NAME",
        help=f"{what} (default: {listed(map(str, default))})",
    )
    parser.set_defaults(**{f"default_{_name(flag)}": list(default)})


def _several(options: argparse.Namespace, flag: str) -> list[Any]:
    """An option's values, each once."""
    given = getattr(options, _name(flag)) or getattr(options, f"default_{_name(flag)}")
    return list(dict.fromkeys(given))


def _name(flag: str) -> str:
    return flag.removeprefix("--").replace("-", "_")
