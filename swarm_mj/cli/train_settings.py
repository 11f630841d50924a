"""From the options of `swarm-mj train` to a run's settings and limits.

The settings bring torch along, which takes its time to import; so functions import them.
"""

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from swarm_mj.cli.options import DEFAULTS, listed
from swarm_mj.cli.train_options import BUDGETS, PLACES, option_flag, shown, stored_value
from swarm_mj.mission import PRESETS, Mission

if TYPE_CHECKING:
    from swarm_mj.learning.run_folder import Limits
    from swarm_mj.learning.settings import Training
    from swarm_mj.policies.policy_config import PolicyConfig

MANY_DECISIONS = 10**12
USUAL_GROUPS = 4  # of missions that end at different times
SHARE_OF_MEMORY = 0.5  # that a run's arrays may take
RANGES = {"learning_rate": (1e-9, 1.0), "entropy": (0.0, 10.0), "discount": (0.0, 1.0)}


def asked_settings(options: argparse.Namespace, init: "PolicyConfig | None" = None) -> "Training":
    """The settings of a new run.

    Args:
        options: As parsed.
        init: Of the policy that it begins with.

    Returns:
        The arm's own settings, changed by the options.

    Raises:
        ValueError: A value is unknown or outside its range, or contradicts another.
    """
    from swarm_mj.learning.settings import arm_settings

    sizes = _sizes(options)
    training = arm_settings(
        "robot" if options.arm is None else options.arm,
        _mission(options, sizes[0]),
        sizes,
        0 if options.seed is None else options.seed,
    )
    if init is not None:
        training = replace(
            training,
            network=init.network,
            features=init.features,
            silence_logit=init.silence_logit,
        )
        _refuse_others(options, training, "network.", f"the policy {options.init}")
        _refuse_others(options, training, "features", f"the policy {options.init}")
    missions = _missions(options.missions, training.missions, len(sizes))
    training = replace(training, missions=missions)  # first, for its errors
    training = replace(training, groups=_groups(missions, len(sizes)))
    training = _changed(training, options)
    _check(training)
    return training


def stored_settings(options: argparse.Namespace, training: "Training") -> "Training":
    """The settings of a run that goes on: its own.

    Args:
        options: As parsed.
        training: What the run began with.

    Returns:
        The same.

    Raises:
        ValueError: An option contradicts them.
    """
    if options.init is not None:
        raise ValueError(f"{options.out} has begun, so --init {options.init} is too late")
    _refuse_others(options, training, "", f"the run in {options.out}")
    return training


def asked_limits(options: argparse.Namespace, arm: str, stored: "Limits | None" = None) -> "Limits":
    """When a run stops: as the options say, else as before, else by the arm's budget.

    Args:
        options: As parsed.
        arm: Whose budget counts if nothing else does.
        stored: The limits of a run that goes on; given ones take their place.

    Returns:
        The limits.

    Raises:
        ValueError: A number is outside its range.
    """
    from swarm_mj.learning.run_folder import Limits

    _check_whole("budget", options.budget)
    _check_whole("replay-every", options.replay_every)
    minutes = options.minutes
    if minutes is not None and not (minutes > 0.0 and math.isfinite(minutes)):
        raise ValueError(f"minutes must be a number above 0, not {minutes:g}")
    limits = stored or Limits(decisions=BUDGETS[arm])
    if options.budget is not None or minutes is not None:
        limits = replace(limits, decisions=options.budget, minutes=minutes)
    if options.replay_every is not None:
        limits = replace(limits, replay_every=options.replay_every)
    return limits


def check_memory(training: "Training", total_bytes: int | None) -> None:
    """Passes if a run's arrays leave enough memory for all the rest.

    Args:
        training: The settings.
        total_bytes: Of the machine; None if it does not tell.

    Raises:
        ValueError: They would take too large a share.
    """
    needed = rollout_bytes(training)
    if total_bytes is not None and needed > SHARE_OF_MEMORY * total_bytes:
        raise ValueError(
            f"rollouts of {training.missions} missions of up to {max(training.robots)} robots take "
            f"{needed / 1e9:.1f} GB, more than half of this machine's {total_bytes / 1e9:.1f} GB; "
            "choose fewer --missions or --robots"
        )


def rollout_bytes(training: "Training") -> int:
    """What a run's largest arrays take: the rollout, and what robots remember of packets."""
    nodes = max(training.robots)
    rows = training.missions * nodes  # a graph each
    graph = nodes * (4 * training.network.num_features + 4 + 1)  # features, parent, may address
    remembered = 4 * nodes**2 if training.features in ("local", "extended") else 0
    return rows * (graph * (training.ppo.num_steps + 1) + remembered)


def _sizes(options: argparse.Namespace) -> tuple[int, ...]:
    return tuple(dict.fromkeys(options.robots or (DEFAULTS.num_robots,)))


def _mission(options: argparse.Namespace, num_robots: int) -> Mission:
    preset = "paper" if options.preset is None else options.preset
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {listed(PRESETS)}, not {preset!r}")
    given = {
        "range_ratio": options.range_ratio,
        "velocity_ratio": options.velocity_ratio,
        "num_windows": options.windows,
        "boundary": options.boundary,
    }
    return PRESETS[preset](
        "stationary" if options.task is None else options.task,
        num_robots=num_robots,
        **{name: value for name, value in given.items() if value is not None},
    )


def _missions(asked: int | None, usual: int, num_sizes: int) -> int:
    """How many missions fly side by side: every team size has as many as the others.

    Raises:
        ValueError: So many cannot be shared out among the sizes.
    """
    if asked is None:
        return -(-usual // num_sizes) * num_sizes
    if asked % num_sizes:
        fewer = asked // num_sizes * num_sizes
        ways = listed(str(n) for n in (fewer, fewer + num_sizes) if n > 0)
        raise ValueError(
            f"missions must be a multiple of the {num_sizes} team sizes, such as {ways}, not "
            f"{asked}"
        )
    return asked


def _groups(missions: int, num_sizes: int) -> int:
    """Into how many groups the missions are shared out evenly, sizes in turn."""
    able = [n for n in range(num_sizes, missions + 1, num_sizes) if missions % n == 0]
    return min(able, key=lambda n: (abs(n - USUAL_GROUPS), -n), default=1)


def _changed(training: "Training", options: argparse.Namespace) -> "Training":
    """The settings with what the options say in place of the arm's own."""
    parts: dict[str, dict[str, Any]] = {"network": {}, "ppo": {}, "": {}}
    for name, place in PLACES.items():
        owner, _, its = place.rpartition(".")
        value = getattr(options, name)
        if owner in parts and name != "robots" and value is not None:
            parts[owner][its] = value
    _check_ranges(options)
    own = parts.pop("")
    if "features" in own:
        parts["network"]["num_features"] = _num_features(own["features"])
    changed = {part: replace(getattr(training, part), **its) for part, its in parts.items()}
    return replace(training, **own, **changed)


def _num_features(features: str) -> int:
    from swarm_mj.gnn.feature_sets import make_extractor

    return len(make_extractor(features, DEFAULTS).names)


def _check(training: "Training") -> None:
    """Raises ValueError for settings that are sound one by one, but not together."""
    for size in training.robots:
        replace(training.mission, num_robots=size)
    if training.reward == "velocity-variance" and training.mission.task != "flocking":
        raise ValueError(
            "reward velocity-variance depends on who talks only if the robots flock; add --task "
            "flocking"
        )


def _check_ranges(options: argparse.Namespace) -> None:
    for name, (low, high) in RANGES.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            raise ValueError(f"{option_flag(name)} must be from {low:g} to {high:g}, not {value:g}")


def _check_whole(label: str, value: int | None) -> None:
    if value is not None and not 1 <= value <= MANY_DECISIONS:
        raise ValueError(f"{label} must be from 1 to {MANY_DECISIONS}, not {value}")


def _refuse_others(
    options: argparse.Namespace, training: "Training", prefix: str, whose: str
) -> None:
    """Raises ValueError if a given option is not what it is in the settings."""
    for name, place in PLACES.items():
        given = _sizes(options) if name == "robots" and options.robots else getattr(options, name)
        if given is None or not place.startswith(prefix):
            continue
        stored = stored_value(training, place)
        if given != stored:
            flag = f"{option_flag(name)} {shown(given)}"
            raise ValueError(f"{flag} is not what {whose} has, {shown(stored)}; leave it out")
