"""Robots of VMAS that talk over this package's radio: how wrong is what they believe?

    pip install swarm_mj vmas
    python training/examples/vmas_link.py

VMAS moves 32 teams; in each of its steps a slot passes, in which some robots send where they are.
Prints how far the teammates are from where robots believe them to be, for three ways to share the
channel.
"""

from collections.abc import Callable

import numpy as np
import torch
import vmas

import swarm_mj

NUM_TEAMS, NUM_ROBOTS, NUM_STEPS = 32, 8, 200
METRES = 250.0  # for each unit of VMAS; a packet reaches as far in silence

Access = Callable[[int, np.random.Generator], np.ndarray]
ACCESS: dict[str, Access] = {
    "all at once": lambda _step, _rng: np.ones((NUM_TEAMS, NUM_ROBOTS), dtype=bool),
    "each by chance, 1 in 8": lambda _step, rng: rng.random((NUM_TEAMS, NUM_ROBOTS)) < 1 / 8,
    "in turns": lambda step, _rng: np.tile(
        np.arange(NUM_ROBOTS) == step % NUM_ROBOTS, (NUM_TEAMS, 1)
    ),
}


def mean_error_m(access: Access) -> float:
    """Return the distance between where teammates are and where robots believe them to be [m]."""
    torch.manual_seed(1)
    env = vmas.make_env(
        "flocking", num_envs=NUM_TEAMS, n_agents=NUM_ROBOTS, continuous_actions=True, seed=1
    )
    env.reset()
    mission = swarm_mj.paper("stationary", num_robots=NUM_ROBOTS)
    link, rng = swarm_mj.Link(mission, seeds=range(NUM_TEAMS)), np.random.default_rng(1)
    team, robot = np.arange(NUM_TEAMS)[:, None], np.arange(NUM_ROBOTS)
    believed_m = np.repeat(positions_m(env)[:, None], NUM_ROBOTS, axis=1)  # the start is known
    errors_m = []
    for step in range(NUM_STEPS):
        env.step(env.get_random_actions())
        position_m = positions_m(env)
        heard = link.deliver(position_m, access(step, rng))
        believed_m[team, robot, heard] = position_m[team, heard]  # who hears nobody hears itself
        believed_m[:, robot, robot] = position_m
        errors_m.append(np.linalg.norm(believed_m - position_m[:, None], axis=3).mean())
    return float(np.mean(errors_m))


def positions_m(env: vmas.simulator.environment.Environment) -> np.ndarray:
    """Return where the robots are: teams by robots by 2 [m]."""
    return METRES * torch.stack([agent.state.pos for agent in env.agents], dim=1).numpy()


if __name__ == "__main__":
    for name, access in ACCESS.items():
        print(f"{name}: {mean_error_m(access):.1f} m")
