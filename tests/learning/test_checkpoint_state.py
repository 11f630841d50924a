"""A checkpoint of other shapes, kinds or ranges than its run's is refused."""

import copy
import math

import pytest
import torch
from small_runs import run, small_training

from swarm_mj.learning.checkpoint_state import check_state
from swarm_mj.learning.run_folder import CHECKPOINT
from swarm_mj.learning.train import make_model


def kept(folder, **changes):
    """The state of a run's checkpoint, and a model like the run's."""
    training = small_training(**changes)
    run(training, folder, 64)
    return torch.load(folder / CHECKPOINT, weights_only=True), make_model(training)[0]


@pytest.fixture(scope="module")
def robots(tmp_path_factory):
    return kept(tmp_path_factory.mktemp("robots"))


@pytest.fixture(scope="module")
def team(tmp_path_factory):
    """A team that is paid for agreeing, so that rewards are normalised."""
    folder = tmp_path_factory.mktemp("team")
    return kept(folder, credit="team", task="flocking", reward="velocity-variance")


def first(state):
    return state["parameters"]["policy.optimizer"]["state"][0]


def group(state):
    return state["parameters"]["policy.optimizer"]["param_groups"][0]


def history(state):
    return next(each for each in state["histories"] if len(each["recipients"]))


def refused(run_kept, change, complaint):
    sound, model = run_kept
    state = copy.deepcopy(sound)
    change(state)
    with pytest.raises((ValueError, KeyError, TypeError), match=complaint):
        check_state(state, model)


def test_a_run_s_own_is_taken(robots, team):
    for state, model in (robots, team):
        assert check_state(state, model).decisions == 64


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda s: s.update(num_timesteps=-1), "Expected `int` >= 0"),
        (lambda s: s.update(num_updates=1.5), "Expected `int`, got `float`"),
        (lambda s: s.pop("num_updates"), "num_updates"),
        (lambda s: s["numpy_rng"].__setitem__(2, -5), "Expected `int` >= 0"),
        (lambda s: s["numpy_rng"].__setitem__(2, 10**6), "Expected `int` <= 624"),
        (lambda s: s["numpy_rng"][1].pop(), "length >= 624"),
        (lambda s: s["progress"].update(minutes=math.nan), "Expected `float` >= 0.0"),
        (lambda s: s["progress"].update(wings=2), "unknown field `wings`"),
        (lambda s: s["progress"]["curve"][0].pop("aoi"), "aoi"),
        (lambda s: s["progress"]["curve"][0].update(aoi=math.inf), "not finite"),
        (lambda s: s["progress"]["curve"][0].update(aoi="1"), "Expected `float`, got `str`"),
        (lambda s: s["progress"]["since_evaluation"].update(delivered=-1), "Expected `int` >= 0"),
        (lambda s: s.update(episode_starts=torch.zeros(20)), "must be .20. of torch.bool"),
        (lambda s: s.update(episode_starts=[True] * 20), "must be .20. of torch.bool"),
        (lambda s: s.update(torch_rng=torch.zeros(3)), "torch_rng must be"),
        (lambda s: s["parameters"]["policy"].popitem(), "it must have"),
        (lambda s: next(iter(s["parameters"]["policy"].values())).fill_(math.nan), "not finite"),
        (lambda s: s["parameters"]["policy.optimizer"]["state"].pop(3), "has other weights"),
        (lambda s: s["candidates"].popitem(), "its candidates are not those of its curve"),
        (lambda s: s["candidates"][0].popitem(), "it must have"),
        (lambda s: next(iter(s["candidates"][64].values())).fill_(math.inf), "not finite"),
        (lambda s: s["progress"]["choice"].update(num_missions=-1), "Expected `int` >= 0"),
        (lambda s: first(s).pop("exp_avg"), "it must have step, exp_avg"),
        (lambda s: first(s).update(exp_avg=torch.zeros(7)), "exp_avg must be"),
        (lambda s: first(s)["step"].fill_(-1.0), "less than no steps"),
        (lambda s: group(s).update(lr=math.nan), "has other settings"),
        (lambda s: group(s).update(betas=(0.9, 2.0)), "has other settings"),
        (lambda s: group(s).pop("eps"), "eps"),
        (lambda s: history(s).update(last_window=10**9), "not within 20"),
        (lambda s: history(s).update(last_window=1), "not within 20"),
        (lambda s: history(s).update(recipients=torch.zeros(1, 1, 5)), "recipients must be"),
        (lambda s: s["histories"].pop(), "zip"),
        (lambda s: s.update(reward_normaliser={"running": {}}), "unlike the run"),
        (
            lambda s: first(s).update(exp_avg=torch.zeros(6, 18).to_sparse()),
            "exp_avg must be .6, 18. of torch.float32",
        ),
    ],
)
def test_what_is_not_the_run_s_is_refused(robots, change, complaint):
    refused(robots, change, complaint)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda s: s.update(reward_normaliser=None), "unlike the run"),
        (lambda s: s["reward_normaliser"]["running"].update(var=-1.0), "Expected `float` >= 0.0"),
        (lambda s: s["reward_normaliser"]["running"].update(mean=math.nan), "no finite mean"),
        (lambda s: s["reward_normaliser"]["returns"].fill_(math.inf), "returns has numbers"),
    ],
)
def test_rewards_are_normalised_as_the_run_s_are(team, change, complaint):
    refused(team, change, complaint)
