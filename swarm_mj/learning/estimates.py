"""Estimates of the memory and disk that a training run takes, from measured peaks."""

from dataclasses import replace

from swarm_mj.learning.run_folder import MAX_DECISIONS, Limits
from swarm_mj.learning.selection import OTHER_FLIGHTS, num_missions
from swarm_mj.learning.settings import Training
from swarm_mj.replay.recorder import replay_file, replay_memory
from swarm_mj.system.needs import (
    ADDRESSES,
    GB,
    LIBRARIES,
    OF_RERUN,
    OF_TORCH,
    TORCH,
    Needs,
    missions_memory,
)


def training_needs(training: Training, limits: Limits) -> Needs:
    """Estimate a run: a rollout and the passes over it, held-out missions, checkpoints, replays."""
    missions = [replace(training.mission, num_robots=size) for size in training.robots]
    largest, rollout = max(missions, key=lambda each: each.num_robots), rollout_bytes(training)
    decisions = limits.decisions or MAX_DECISIONS
    num_flown = num_missions(training, decisions, 1 + OTHER_FLIGHTS)  # at most, to choose
    held_out = missions_memory(largest.num_robots, num_flown, is_learned=True)
    under_way = (
        missions_memory(largest.num_robots, training.missions, is_learned=True) - LIBRARIES - TORCH
    )
    # What leaves out silent rows sorts a copy of the others before it passes over them.
    memory = held_out + under_way + max(2.0 * rollout, rollout + passes_bytes(training))
    file = 2.0 * training.missions * largest.num_robots * largest.num_windows + 0.01 * GB
    if limits.replay_every is None:
        return Needs(memory=memory, addresses=ADDRESSES + OF_TORCH, file=file)
    num_replays = 1 + (limits.decisions or 0) // limits.replay_every
    return Needs(
        memory=memory + replay_memory(missions[0], missions[0].num_windows),
        addresses=ADDRESSES + OF_TORCH + OF_RERUN,
        file=file + num_replays * replay_file(missions[0]),
        largest_file=max(file, replay_file(missions[0])),
    )


def rollout_bytes(training: Training) -> int:
    """Return the size of a run's largest arrays: the rollout, and the robots' packet memory."""
    nodes = max(training.robots)
    rows = training.missions * nodes  # a graph each
    graph = nodes * (4 * training.network.num_features + 4 + 1)  # features, parent, may address
    remembered = 4 * nodes**2 if training.features in ("local", "extended") else 0
    return rows * (graph * (training.ppo.num_steps + 1) + remembered)


def passes_bytes(training: Training) -> float:
    """Return the size of the activations that a minibatch keeps for its gradient."""
    nodes, ppo, shape = max(training.robots), training.ppo, training.network
    rows = training.missions * nodes * ppo.num_steps / ppo.num_minibatches
    kept = 0.4 if training.drops_silence else 1.0  # of the rows
    directions = 2 if shape.edges == "both" else 1
    layers = (shape.receptive_field + 1) * (shape.depth + 1) * (2 + directions)
    networks = 1 if training.shares_trunk else 2
    return 4.0 * kept * rows * nodes * shape.latent * layers * networks
