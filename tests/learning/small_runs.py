"""Training runs of a second or less, and what they leave."""

import math
from dataclasses import replace

import torch
from safetensors.torch import load_file

from swarm_mj.learning.run_folder import CHECKPOINT, Limits, TrainingRun
from swarm_mj.learning.selection import CurveRow, HeldOutCosts
from swarm_mj.learning.settings import usual_settings
from swarm_mj.learning.train import train
from swarm_mj.mission import paper
from swarm_mj.policies.gnn.feature_sets import num_features

torch.set_num_threads(1)  # tests share the machine's cores


def small_training(credit="robot", task="stationary", sizes=(5,), discount=None, **changes):
    """Settings of tiny networks on short missions; rollouts of 32 decisions, 64 of two sizes.

    Per robot they see turns of an order, in which no bound holds, and credits are as they are.
    """
    mission = paper(task, num_robots=sizes[0], num_windows=20, range_ratio=0.6)
    its = usual_settings(credit, mission, sizes, seed=3)
    is_short_sighted = credit == "team" or (discount or 0.0) > 0.0
    horizon = 1 if is_short_sighted else 3
    ppo = replace(its.ppo, num_steps=8, num_minibatches=3, num_epochs=2, horizon=horizon)
    network = replace(its.network, latent=6, depth=2, receptive_field=1)
    if credit == "robot":
        network = replace(network, num_features=num_features("extended"))
        its = replace(its, features="extended", network=network, unknown_age=0.0)
    usual = {
        "ppo": ppo if discount is None else replace(ppo, discount=discount),
        "network": network,
        "missions": 4 * len(sizes),
        "evaluate_every": 64 * len(sizes),
        "held_out": 2,
    }
    return replace(its, **usual | changes)


def evaluation(decisions, **its):
    """One of an age; what is not given is of no interest."""
    others = ("aoi_steady", "velocity_variance", "packets_per_window", "delivery_ratio")
    costs = {"aoi": 1.0, "objective": 1.0} | dict.fromkeys(others, 0.5) | its
    return CurveRow(decisions=decisions, minutes=0.5, costs=HeldOutCosts(**costs))


def go_on(_status):
    """A listener that never has enough."""
    return True


class StopAfter:
    """A listener that has had enough after so many windows; evaluations do not count."""

    def __init__(self, windows):
        self.left = windows

    def __call__(self, status):
        self.left -= status.evaluated is None
        return self.left > 0


def run(training, folder, decisions=192, listener=go_on, *, init=None, is_resumed=False, **limits):
    """Trains; checkpoints stand between all rollouts."""
    limits = Limits(**{"decisions": decisions, "checkpoint_every_s": 0.0} | limits)
    asked = TrainingRun(training=training, limits=limits, init=init, device="cpu")
    return train(asked, folder, listener=listener, is_resumed=is_resumed)


def end_of(folder):
    """All that a run has come to but its time: weights, optimiser, random states, curve, policy."""
    state = torch.load(folder / CHECKPOINT, weights_only=True)
    progress = state.pop("progress")
    progress["minutes"] = progress["since_evaluation"]["seconds"] = None
    progress["evaluation_minutes"] = None
    for row in progress["curve"]:
        row["minutes"] = row["rollout/decisions_per_s"] = None
    policy = load_file(folder / "policy.safetensors")
    curve = (folder / "curve.csv").read_text().splitlines()
    return {**state, "progress": progress, "policy file": policy, "curve rows": len(curve)}


def difference(first, second, name=""):
    """Where two nested things of tensors differ first, in any bit; empty if nowhere."""
    if isinstance(first, torch.Tensor):
        return "" if torch.equal(first, second) else name
    if isinstance(first, dict) and first.keys() == second.keys():
        found = (difference(first[key], second[key], f"{name} {key}") for key in first)
        return next(filter(None, found), "")
    if isinstance(first, list) and len(first) == len(second):
        found = (difference(a, b, name) for a, b in zip(first, second, strict=True))
        return next(filter(None, found), "")
    both_are_nan = all(isinstance(x, float) and math.isnan(x) for x in (first, second))
    return "" if first == second or both_are_nan else name
