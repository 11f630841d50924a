"""Interfaces of other people's libraries, and their names in Gymnasium's registry."""

from typing import get_args

from swarm_mj.mission import Task


def register_environments() -> None:
    """Register `swarm_mj/Flocking-v0` and the other tasks for `gymnasium.make` and `make_vec`.

    Each takes the options of `envs.options.make_batch`, among them any field of `Mission`.
    """
    # The other interfaces need no Gymnasium; and `gymnasium` here is a module of this folder.
    from gymnasium.envs.registration import register, registry

    for task in get_args(Task):
        name = environment_id(task)
        if name not in registry:
            register(
                name,
                entry_point="swarm_mj.envs.gymnasium:SwarmEnv",
                vector_entry_point="swarm_mj.envs.gymnasium_vector:SwarmVectorEnv",
                kwargs={"mission": task},
            )


def environment_id(task: str) -> str:
    """Return a task's environment: `swarm_mj/RandomWalk-v0` is that of `random-walk`."""
    return f"swarm_mj/{task.title().replace('-', '')}-v0"
