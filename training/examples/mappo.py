"""Multi-agent PPO in plain PyTorch: robots share one network; a critic sees the truth in training.

    python training/examples/mappo.py --out curve.png

Robots decide by what they have heard alone. The critic, which no robot takes along, sees where all
robots are and how old their information is (Yu et al. 2022, "The Surprising Effectiveness of PPO in
Cooperative Multi-Agent Games"). The age of information is that of missions 1000 to 1019, on which
nothing is trained; lower is better.
"""

import argparse
import time

import matplotlib.pyplot as plt
import torch
from torch import nn
from torch.distributions import Categorical

import swarm_mj
from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED, MissionBatch
from swarm_mj.envs.options import make_batch, truth, truth_space
from swarm_mj.mission import paper

SEED, NUM_ROBOTS, NUM_WINDOWS = 0, 5, 100
NUM_MISSIONS, NUM_ROUNDS = 16, 60  # flown side by side, and one after the other
HELD_OUT = range(1000, 1020)
DISCOUNT, LAMBDA, CLIP, ENTROPY = 0.9, 0.9, 0.2, 0.002
NUM_EPOCHS, MINIBATCH, LEARNING_RATE = 4, 1000, 1e-3
ROUNDS_PER_POINT = 4
BASELINES = ("random-flooding", "tdma")


class ActorCritic(nn.Module):
    """One network that all robots share, and one that values a team's true state."""

    def __init__(self, num_features: int, num_truths: int) -> None:
        super().__init__()
        self.actor = nn.Sequential(
            nn.Linear(NUM_ROBOTS * num_features, 64), nn.Tanh(), nn.Linear(64, NUM_ROBOTS)
        )
        self.critic = nn.Sequential(
            nn.Linear(num_truths, 128), nn.Tanh(), nn.Linear(128, 128), nn.Tanh(), nn.Linear(128, 1)
        )

    def recipients(self, seen: torch.Tensor, mask: torch.Tensor) -> Categorical:
        """Return whom each robot may address, by its own view [..., N, F] and mask [..., N]."""
        return Categorical(logits=self.actor(seen.flatten(-2)).masked_fill(mask == 0, -1e9))

    def value(self, state: torch.Tensor) -> torch.Tensor:
        """Return the discounted rewards that a team may expect."""
        return self.critic(state).squeeze(-1)


def view(batch: MissionBatch) -> dict[str, torch.Tensor]:
    """Return what robots see, and what the critic does."""
    seen = {name: torch.as_tensor(each.copy()) for name, each in batch.observation.items()}
    return {"seen": seen["observation"], "mask": seen["action_mask"], "state": _truth(batch)}


def _truth(batch: MissionBatch) -> torch.Tensor:
    return torch.as_tensor(truth(batch))


@torch.no_grad()
def fly(network: ActorCritic, batch: MissionBatch) -> dict[str, torch.Tensor]:
    """Fly missions that have begun to their end; return all windows, [T, B, ...] each."""
    windows = []
    while not batch.is_over:
        now = view(batch)
        choice = network.recipients(now["seen"], now["mask"])
        action = choice.sample()
        reward = batch.step(action.numpy())[:, 0] / NUM_WINDOWS
        now |= {"action": action, "log_prob": choice.log_prob(action)}
        windows.append(now | {"reward": torch.as_tensor(reward, dtype=torch.float32)})
    flown = {name: torch.stack([each[name] for each in windows]) for name in windows[0]}
    return flown | {"last_state": _truth(batch)}


@torch.no_grad()
def add_advantages(network: ActorCritic, flown: dict[str, torch.Tensor]) -> None:
    """Estimate advantages (GAE, Schulman et al. 2016); a mission is cut off, it reaches no end."""
    values = torch.cat([network.value(flown["state"]), network.value(flown["last_state"])[None]])
    advantage = torch.zeros_like(values)
    for t in reversed(range(NUM_WINDOWS)):
        error = flown["reward"][t] + DISCOUNT * values[t + 1] - values[t]
        advantage[t] = error + DISCOUNT * LAMBDA * advantage[t + 1]
    flown["target"] = advantage[:-1] + values[:-1]
    flown["advantage"] = (advantage[:-1] - advantage[:-1].mean()) / advantage[:-1].std()


def loss_of(network: ActorCritic, rows: dict[str, torch.Tensor]) -> torch.Tensor:
    """Return PPO's clipped loss of some windows, with that of the critic."""
    choice = network.recipients(rows["seen"], rows["mask"])
    ratio = (choice.log_prob(rows["action"]) - rows["log_prob"]).exp()
    advantage = rows["advantage"][:, None]  # the same for all robots of a team
    clipped = torch.minimum(ratio * advantage, ratio.clamp(1 - CLIP, 1 + CLIP) * advantage)
    error = (network.value(rows["state"]) - rows["target"]).square()
    return error.mean() - clipped.mean() - ENTROPY * choice.entropy().mean()


def improve(
    network: ActorCritic, optimiser: torch.optim.Optimizer, flown: dict[str, torch.Tensor]
) -> None:
    """Take the steps of one round."""
    names = ("seen", "mask", "state", "action", "log_prob", "advantage", "target")
    windows = {name: flown[name].flatten(0, 1) for name in names}
    for _ in range(NUM_EPOCHS):
        for rows in torch.randperm(NUM_WINDOWS * NUM_MISSIONS).split(MINIBATCH):
            loss = loss_of(network, {name: each[rows] for name, each in windows.items()})
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 0.5)
            optimiser.step()


def train() -> list[tuple[int, float]]:
    """Return windows flown so far, and the age of information then [windows]."""
    torch.manual_seed(SEED)
    mission = paper("stationary", num_robots=NUM_ROBOTS, num_windows=NUM_WINDOWS)
    batch = make_batch(mission, NUM_MISSIONS)
    held_out = make_batch(mission, len(HELD_OUT))
    network = ActorCritic(batch.num_features, truth_space(batch.mission).shape[0])
    optimiser = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
    curve = []
    for n in range(NUM_ROUNDS + 1):
        if n % ROUNDS_PER_POINT == 0:
            held_out.restart(list(HELD_OUT))
            age = -fly(network, held_out)["reward"].mean().item() * NUM_WINDOWS
            curve.append((n * NUM_MISSIONS * NUM_WINDOWS, age))
            print(f"after {curve[-1][0]} windows: {age:.2f} windows old", flush=True)
        first = FIRST_TRAINING_SEED + n * NUM_MISSIONS
        batch.restart(range(first, first + NUM_MISSIONS))
        flown = fly(network, batch)
        add_advantages(network, flown)
        improve(network, optimiser, flown)
    return curve


def draw(curve: list[tuple[int, float]], path: str) -> None:
    """Draw the learning curve beside the baselines on the same missions."""
    mission = swarm_mj.paper("stationary", num_robots=NUM_ROBOTS, num_windows=NUM_WINDOWS)
    flown = swarm_mj.evaluate(
        list(BASELINES), mission, num_missions=len(HELD_OUT), seed=HELD_OUT[0]
    ).summary
    plt.style.use("swarm_mj.evaluation.figures.paper")
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    windows, ages = zip(*curve, strict=True)
    axes.plot(windows, ages, label="MAPPO, with a critic that sees the truth")
    for name, style in zip(BASELINES, ("--", ":"), strict=True):
        age = flown[name].aoi_mean
        axes.axhline(age, color="black", linestyle=style, label=f"{name}: {age:.1f}")
    axes.set(xlabel="windows flown in training", ylabel="age of information [windows]")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Train for a minute or two, and draw the learning curve."""
    parser = argparse.ArgumentParser(description="MAPPO with a centralised critic.")
    parser.add_argument("--out", default="curve.png", help="the picture")
    out = parser.parse_args().out
    began = time.monotonic()
    curve = train()
    print(f"{time.monotonic() - began:.0f} s")
    draw(curve, out)


if __name__ == "__main__":
    main()
