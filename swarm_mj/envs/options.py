"""Names that an environment does not have, and what their users most likely mean."""

import re
from collections.abc import Collection, Mapping
from typing import Any, get_args

from swarm_mj.envs.registration import NAMESPACE, environment_id
from swarm_mj.mission import Mission, Task
from swarm_mj.system.fields import did_you_mean


def check_task(mission: Mission | str) -> None:
    """Pass for a mission, or a task.

    Raises:
        ValueError: There is no such task; what looks like an environment's name may mean one.
    """
    tasks = get_args(Task)
    if not isinstance(mission, Mission) and mission not in tasks:
        plain = str(mission).removeprefix(f"{NAMESPACE}/").partition("-v")[0]
        typed = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", plain).lower()
        raise ValueError(
            f"task must be one of {', '.join(tasks)}, not {mission!r:.80}"
            f"{did_you_mean(typed, tasks)}"
        )


def check_fields(mission: Mission | str, fields: Mapping[str, Any]) -> None:
    """Pass unless an option has its place elsewhere; names unknown to all are left to `Mission`.

    Raises:
        TypeError: It has.
    """
    if "seed" in fields:
        raise TypeError("seed is no option of an environment; give it to reset(seed=...)")
    if "task" in fields and not isinstance(mission, Mission):
        task = fields["task"]
        raise TypeError(
            f"the environment's name or first argument settles the task, here {mission!r:.80}; use "
            f"{environment_id(str(task)):.80} or {task!r:.80} there, and leave task= out"
        )


def check_features_named(features: object) -> None:
    """Pass for a name, which stored policies keep.

    Raises:
        TypeError: The features are a class, or something else.
    """
    if not isinstance(features, str):
        is_class = isinstance(features, type)
        name = f"{features.__module__}:{features.__qualname__}" if is_class else "module:Name"
        raise TypeError(
            f'features must be named, as stored policies keep the name; write features="{name}"'
        )


def check_reset(options: Collection[str], known: Collection[str] = ()) -> None:
    """Pass if these are options of `reset`.

    Raises:
        ValueError: One is not.
    """
    for name in options:
        if name not in known:
            raise ValueError(
                f"reset has no option {name!r:.80}; it has {', '.join(known) or 'none'}"
            )
