"""Independent PPO by TorchRL on the PettingZoo face: robots share one network, and each decides.

    pip install swarm_mj pettingzoo torchrl
    python training/examples/torchrl_ippo.py

Prints the mean age of information on missions that are not trained on; lower is better.
"""

import torch
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import EnvBase, FlattenObservation, PettingZooWrapper, TransformedEnv
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import MaskedCategorical, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from swarm_mj.envs.pettingzoo import parallel_env

NUM_ROBOTS, NUM_FEATURES, NUM_WINDOWS = 5, 18, 100
WINDOWS_PER_BATCH, NUM_BATCHES, NUM_EPOCHS, MINIBATCH = 500, 40, 4, 100
TEAM = "robots"
SEEN, MASK, LOGITS, ACTION, LOG_PROB, VALUE, REWARD, DONE, TERMINATED = (
    (TEAM, "observation", "observation"),
    *((TEAM, name) for name in ("action_mask", "logits", "action", "log_prob", "state_value")),
    *((TEAM, name) for name in ("reward", "done", "terminated")),
)


def make_env(reward: str) -> EnvBase:
    """Make a stationary team; `credit` rewards each robot for its own packet."""
    mission = parallel_env(
        "stationary", num_robots=NUM_ROBOTS, num_windows=NUM_WINDOWS, reward=reward
    )
    robots = {TEAM: mission.possible_agents}
    env = PettingZooWrapper(mission, categorical_actions=True, group_map=robots)
    return TransformedEnv(env, FlattenObservation(-2, -1, in_keys=[SEEN]))


def perceptron(num_outputs: int) -> nn.Module:
    """Return a network over what one robot knows; all robots share it."""
    return nn.Sequential(
        nn.Linear(NUM_ROBOTS * NUM_FEATURES, 64), nn.Tanh(), nn.Linear(64, num_outputs)
    )


def make_actor(env: EnvBase) -> ProbabilisticActor:
    """Return the network that draws whom a robot addresses, among those that the mask allows."""
    network = TensorDictModule(perceptron(NUM_ROBOTS), in_keys=[SEEN], out_keys=[LOGITS])
    return ProbabilisticActor(
        network,
        spec=env.full_action_spec_unbatched,
        in_keys={"logits": LOGITS, "mask": MASK},
        out_keys=[ACTION],
        distribution_class=MaskedCategorical,
        return_log_prob=True,
        log_prob_key=LOG_PROB,
    )


def mean_age(actor: ProbabilisticActor, num_missions: int = 5) -> float:
    """Return the age of information, which is minus the reward `aoi` [windows]."""
    env = make_env("aoi")
    env.set_seed(0)
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        flown = [env.rollout(NUM_WINDOWS, actor) for _ in range(num_missions)]
    return -torch.stack([each["next", TEAM, "reward"].mean() for each in flown]).mean().item()


def main() -> None:
    """Train for about a minute."""
    torch.manual_seed(0)
    env = make_env("credit")
    actor = make_actor(env)
    critic = ValueOperator(perceptron(1), in_keys=[SEEN], out_keys=[VALUE])
    loss = ClipPPOLoss(actor, critic, entropy_coeff=0.002, normalize_advantage=True)
    loss.set_keys(
        reward=REWARD, action=ACTION, sample_log_prob=LOG_PROB, value=VALUE, done=DONE,
        terminated=TERMINATED,
    )  # fmt: skip
    loss.make_value_estimator(ValueEstimators.TD0, gamma=0.0)  # credit is its own window's alone
    optimiser = torch.optim.Adam(loss.parameters(), lr=1e-3)
    collector = Collector(
        env,
        actor,
        frames_per_batch=WINDOWS_PER_BATCH,
        total_frames=NUM_BATCHES * WINDOWS_PER_BATCH,
    )
    print(f"before: {mean_age(actor):.1f} windows old")
    for n, batch in enumerate(collector, start=1):
        for _ in range(NUM_EPOCHS):
            with torch.no_grad():
                loss.value_estimator(
                    batch,
                    params=loss.critic_network_params,
                    target_params=loss.target_critic_network_params,
                )
            for rows in torch.randperm(WINDOWS_PER_BATCH).split(MINIBATCH):
                losses = loss(batch[rows])
                total = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
                optimiser.zero_grad()
                total.backward()
                nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimiser.step()
        if n % 10 == 0:
            print(f"after {n * WINDOWS_PER_BATCH} windows: {mean_age(actor):.1f} windows old")
    collector.shutdown()


if __name__ == "__main__":
    main()
