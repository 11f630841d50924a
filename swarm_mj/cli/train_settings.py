"""From the options of `swarm-mj train` to a run's settings and limits."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarm_mj.cli.train_options import stored_value, typed
from swarm_mj.gnn.feature_sets import num_features
from swarm_mj.learning.run_folder import Limits
from swarm_mj.learning.settings import Training, usual_settings
from swarm_mj.mission import PRESETS, Mission
from swarm_mj.policies.policy_config import PolicyConfig

BUDGETS = {"robot": 200_000, "team": 2_000_000}  # team decisions; the paper's for the paper's way
USUAL_GROUPS = 4  # of missions that end at different times
SHARE_OF_MEMORY = 0.5  # that a run's arrays may take


def asked_settings(
    given: dict[str, Any], init: PolicyConfig | None = None, init_path: Path | None = None
) -> Training:
    """The settings of a new run.

    Args:
        given: The settings that were given, by their places.
        init: Of the policy that it begins with.
        init_path: Where that policy is.

    Returns:
        The usual settings of the credit assignment, changed by those given.

    Raises:
        ValueError: A value is unknown or outside its range, or contradicts another.
    """
    sizes = given.get("robots", (Mission().num_robots,))
    training = usual_settings(
        given.get("arm", "robot"), _mission(given, sizes[0]), sizes, given.get("seed", 0)
    )
    if init is not None:
        training = replace(
            training,
            network=init.network,
            features=init.features,
            silence_logit=init.silence_logit,
        )
        shape = {place: value for place, value in given.items() if _is_shape(place)}
        refuse_others(shape, training, f"the policy {init_path}")
    missions = _missions(given.get("missions"), training.missions, len(sizes))
    training = replace(training, missions=missions)  # first, for its errors
    training = replace(training, groups=_groups(missions, len(sizes)))
    training = _changed(training, given)
    _check(training)
    return training


def refuse_others(given: dict[str, Any], training: Training, whose: str) -> None:
    """Passes if given settings are those of a run, or of the policy that it begins with.

    Raises:
        ValueError: One contradicts.
    """
    for place, value in given.items():
        stored = stored_value(training, place)
        if value != stored:
            has = typed(place, stored).partition(" ")[2]
            raise ValueError(f"{typed(place, value)} is not what {whose} has, {has}; leave it out")


def asked_limits(
    limits: Limits | None,
    arm: str,
    *,
    budget: int | None = None,
    minutes: float | None = None,
    replay_every: int | None = None,
) -> Limits:
    """When a run stops: as asked, else as before, else by the usual budget.

    Args:
        limits: Of a run that goes on; given ones take their place.
        arm: Whose budget counts if nothing else does.
        budget: Team decisions in all.
        minutes: In all.
        replay_every: Team decisions between two replays.

    Returns:
        The limits.

    Raises:
        ValueError: The time is no positive number.
    """
    if minutes is not None and not (minutes > 0.0 and math.isfinite(minutes)):
        raise ValueError(f"minutes must be a number above 0, not {minutes:g}")
    limits = limits or Limits(decisions=BUDGETS[arm])
    if budget is not None or minutes is not None:
        limits = replace(limits, decisions=budget, minutes=minutes)
    if replay_every is not None:
        limits = replace(limits, replay_every=replay_every)
    return limits


def check_memory(training: Training, total_bytes: int | None) -> None:
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


def rollout_bytes(training: Training) -> int:
    """What a run's largest arrays take: the rollout, and what robots remember of packets."""
    nodes = max(training.robots)
    rows = training.missions * nodes  # a graph each
    graph = nodes * (4 * training.network.num_features + 4 + 1)  # features, parent, may address
    remembered = 4 * nodes**2 if training.features in ("local", "extended") else 0
    return rows * (graph * (training.ppo.num_steps + 1) + remembered)


def _mission(given: dict[str, Any], num_robots: int) -> Mission:
    own = {place.partition(".")[2]: v for place, v in given.items() if place.startswith("mission.")}
    preset, task = own.pop("preset", "paper"), own.pop("task", "stationary")
    replace(Mission(), preset=preset, task=task)  # refuses what is unknown
    return PRESETS[preset](task, num_robots=num_robots, **own)


def _missions(asked: int | None, usual: int, num_sizes: int) -> int:
    """How many missions fly side by side: every team size has as many as the others.

    Raises:
        ValueError: So many cannot be shared out among the sizes.
    """
    if asked is None:
        return -(-usual // num_sizes) * num_sizes
    if asked % num_sizes:
        fewer = asked // num_sizes * num_sizes
        ways = ", ".join(str(n) for n in (fewer, fewer + num_sizes) if n > 0)
        raise ValueError(
            f"missions must be a multiple of the {num_sizes} team sizes, such as {ways}, not "
            f"{asked}"
        )
    return asked


def _groups(missions: int, num_sizes: int) -> int:
    """Into how many groups the missions are shared out evenly, sizes in turn."""
    able = [n for n in range(num_sizes, missions + 1, num_sizes) if missions % n == 0]
    return min(able, key=lambda n: (abs(n - USUAL_GROUPS), -n), default=1)


def _changed(training: Training, given: dict[str, Any]) -> Training:
    """The settings with what was given in place of the usual."""
    parts: dict[str, dict[str, Any]] = {"network": {}, "ppo": {}, "": {}}
    for place, value in given.items():
        part, _, name = place.rpartition(".")
        if part in parts:
            parts[part][name] = value
    own = parts.pop("")
    if "features" in own:
        parts["network"]["num_features"] = num_features(own["features"])
    changed = {part: replace(getattr(training, part), **its) for part, its in parts.items()}
    return replace(training, **own, **changed)


def _is_shape(place: str) -> bool:
    return place == "features" or place.startswith("network.")


def _check(training: Training) -> None:
    """Raises ValueError for settings that are sound one by one, but not together."""
    for size in training.robots:
        replace(training.mission, num_robots=size)
    if training.reward == "velocity-variance" and training.mission.task != "flocking":
        raise ValueError(
            "reward velocity-variance depends on who talks only if the robots flock; add --task "
            "flocking"
        )
