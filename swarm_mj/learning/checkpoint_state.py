"""What a checkpoint must be before a run goes on from it: every shape, kind and range.

A checkpoint that is crafted, or of another run, would else be noticed when much is overwritten.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

import torch
from msgspec import Meta
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor

from swarm_mj.envs.mission_batch import MissionBatch
from swarm_mj.learning.actor_critic import GnnActorCritic
from swarm_mj.learning.choice import Amount, Count, candidates
from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.held_out import HeldOut
from swarm_mj.learning.run_folder import Progress
from swarm_mj.system.reading import read_plain

OPTIONAL = ("aoi_sem",)  # of what a held-out evaluation has
IN_A_ROW = {"decisions", "minutes", *(spec.name for spec in fields(HeldOut))}.difference(OPTIONAL)
ADAM_SETTINGS = {"betas", "eps", "weight_decay", "params"}  # other versions of torch have others
Word = Annotated[int, Meta(ge=0, lt=2**32)]


@dataclass(frozen=True, kw_only=True)
class _Counters:
    """What a checkpoint has beside tensors and states of its own kind."""

    num_timesteps: Count
    num_updates: Count
    numpy_rng: tuple[
        Literal["MT19937"],
        Annotated[list[Word], Meta(min_length=624, max_length=624)],
        Annotated[int, Meta(ge=0, le=624)],  # NumPy reads the word there unchecked
        Annotated[int, Meta(ge=0, le=1)],
        float,
    ]
    progress: Progress


@dataclass(frozen=True, kw_only=True)
class _Running:
    """The moments of `VecNormalize`."""

    mean: float
    var: Amount
    count: Amount


def check_state(state: Mapping[str, Any], model: PPO) -> Progress:
    """Pass for the state of a model's run; returns where that run stands.

    Raises:
        ValueError: It is not.
        Exception: A part is missing, or of quite another kind.
    """
    named = {spec.name: state[spec.name] for spec in fields(_Counters)}
    counters = read_plain(named, _Counters)
    for row in counters.progress.curve:
        if not all(math.isfinite(row[name]) for name in IN_A_ROW):
            raise ValueError("its curve has numbers that are not finite")
    _check_parameters(state["parameters"], model)
    _check_candidates(state["candidates"], counters.progress, model)
    starts = torch.zeros(model.n_envs, dtype=torch.bool)
    _check_tensors({"episode_starts": state["episode_starts"]}, {"episode_starts": starts})
    _check_tensors({"torch_rng": state["torch_rng"]}, {"torch_rng": torch.get_rng_state()})
    for batch, history in zip(env_of(model).batches, state["histories"], strict=True):
        _check_history(history, batch)
    _check_normaliser(state["reward_normaliser"], model)
    return counters.progress


def _check_parameters(given: Mapping[str, Any], model: PPO) -> None:
    """Of the networks, and of Adam, which has nothing before its first step."""
    own = model.get_parameters()
    weights, adam = own["policy"], own["policy.optimizer"]
    _check_tensors(given["policy"], weights)
    kept, groups = given["policy.optimizer"]["state"], given["policy.optimizer"]["param_groups"]
    (group,), (own_group,) = groups, adam["param_groups"]
    settings = {*ADAM_SETTINGS, *(own_group.keys() & group.keys())} - {"lr"}
    is_same = all(group[name] == own_group[name] for name in settings)
    if not is_same or not 0.0 <= read_plain(group["lr"], float) <= 1.0:
        raise ValueError("its optimiser has other settings")
    parameters = dict(enumerate(model.policy.parameters()))
    if kept and kept.keys() != parameters.keys():
        raise ValueError("its optimiser has other weights")
    for index, moments in kept.items():
        like = parameters[index]
        _check_tensors(moments, {"step": torch.zeros(()), "exp_avg": like, "exp_avg_sq": like})
        if moments["step"] < 0:
            raise ValueError("its optimiser has made less than no steps")


def _check_candidates(
    given: Mapping[int, Mapping[str, Any]], progress: Progress, model: PPO
) -> None:
    """Of the policies that may be kept."""
    if given.keys() != {int(row["decisions"]) for row in candidates(progress.curve)}:
        raise ValueError("its candidates are not those of its curve")
    assert isinstance(model.policy, GnnActorCritic)
    like = model.policy.acting_network().state_dict()
    for weights in given.values():
        _check_tensors(weights, like)


def _check_history(history: Mapping[str, Any], batch: MissionBatch) -> None:
    """Of a batch's missions; replaying it checks their seeds, and the robots addressed."""
    num_windows, recipients = batch.mission.num_windows, history["recipients"]
    last = read_plain(history["last_window"], int)
    if not len(recipients) < last <= num_windows:
        raise ValueError(f"its missions end at window {last:.0f}, not within {num_windows}")
    shape = (len(recipients), batch.num_missions, batch.mission.num_robots)
    expected = torch.zeros(shape if len(recipients) else (0,), dtype=torch.int16)
    _check_tensors({"recipients": recipients}, {"recipients": expected})


def _check_normaliser(state: Mapping[str, Any] | None, model: PPO) -> None:
    env = model.get_env()
    if not isinstance(env, VecNormalize) or state is None:
        if isinstance(env, VecNormalize) or state is not None:
            raise ValueError("it normalises rewards, or does not, unlike the run")
        return
    running = read_plain(state["running"], _Running)
    if not math.isfinite(running.mean):
        raise ValueError("its rewards have no finite mean")
    _check_tensors({"returns": state["returns"]}, {"returns": torch.tensor(env.returns)})


def _check_tensors(given: Mapping[str, Any], expected: Mapping[str, Tensor]) -> None:
    """Pass for plain and finite tensors of the same names, shapes and kinds, else ValueError."""
    if given.keys() != expected.keys():
        raise ValueError(f"it must have {', '.join(expected)}")
    for name, wanted in expected.items():
        tensor = given[name]
        is_plain = type(tensor) is Tensor and tensor.layout == torch.strided
        if not is_plain or (tensor.shape, tensor.dtype) != (wanted.shape, wanted.dtype):
            raise ValueError(f"{name} must be {list(wanted.shape)} of {wanted.dtype}")
        if not torch.isfinite(tensor).all():
            raise ValueError(f"{name} has numbers that are not finite")
