"""From options to settings and limits; what the help says is what both kinds of credit have."""

from dataclasses import replace
from functools import reduce
from pathlib import Path

import pytest
from tiny_policies import tiny_config, tiny_network

from swarm_mj.cli import main, parse
from swarm_mj.cli.train import asked_limits
from swarm_mj.cli.train_settings import asked_settings, refuse_others
from swarm_mj.learning.run_folder import Limits
from swarm_mj.learning.settings import ORDERLY_SILENCE, usual_settings
from swarm_mj.learning.ways import ROBOT, TEAM
from swarm_mj.mission import paper


def options(*arguments):
    return parse(["train", "--out", "runs/x", *map(str, arguments)])[1]


def given(*arguments):
    """The settings that a command line gives."""
    return options(*arguments).settings


def asked(*arguments):
    return asked_settings(given(*arguments))


def test_the_defaults_that_the_help_shows_are_the_usual_settings(capsys):
    main(["train", "--help-all"])
    shown = " ".join(capsys.readouterr().out.split())
    robot, team = (usual_settings(each, paper("stationary"), (40,)) for each in ("robot", "team"))
    for text in (
        f"is applied, 0 to 16 (default: {robot.network.receptive_field}, team: 5)",
        f"width of every layer, 1 to 1024 (default: {robot.network.latent}, team: 64)",
        f"at the start, 1e-09 to 1 (default: {robot.ppo.learning_rate}, team: 0.0001)",
        f"entropy bonus, 0 to 10 (default: {robot.ppo.entropy}, team: 1e-06)",
        "evaluations and earlier sessions included, more than 0",
        f"(default: {robot.features}, team: the preset's own)",
        f"by each of its candidates, 1 to 4096 (default: {robot.missions}, team: {team.missions})",
        "is the same policy, 0 or more (default: 0)",
        "stationary, random-walk, flocking (default: stationary)",
        "paper, reference, indoor, urban, open-field (default: paper)",
        "several are trained on together, 2 to 200 (default: 40)",
        "reflect, none (default: the preset's own)",
        f"task, range and so on, 1 to 10000 (default: {robot.held_out})",
        f"(default: {ROBOT.budget}, team and index-csma: {TEAM.budget}; none with",
    ):
        assert text in shown


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_without_options_a_run_has_the_usual_settings(credit):
    assert asked("--credit", credit) == usual_settings(credit, paper("stationary"), (40,))
    assert asked("--arm", credit) == asked("--credit", credit)  # its flag in earlier releases


@pytest.mark.parametrize(
    ("option", "value", "place"),
    [
        ("--seed", 7, "seed"),
        ("--receptive-field", 3, "network.receptive_field"),
        ("--edges", "reference", "network.edges"),
        ("--learning-rate", 0.5, "ppo.learning_rate"),
        ("--entropy", 0.75, "ppo.entropy"),
        ("--rollout-windows", 64, "ppo.num_steps"),
        ("--credit-horizon", 6, "ppo.horizon"),
        ("--minibatches", 3, "ppo.num_minibatches"),
        ("--most-speech", 0.3, "most_speech"),
        ("--unknown-age", 25.0, "unknown_age"),
        ("--threads", 2, "threads"),
        ("--task", "flocking", "mission.task"),
        ("--preset", "reference", "mission.preset"),
        ("--range-ratio", 0.5, "mission.range_ratio"),
        ("--windows", 77, "mission.num_windows"),
        ("--boundary", "none", "mission.boundary"),
    ],
)
def test_every_option_reaches_its_setting_and_no_other(option, value, place):
    usual, changed = asked(), asked(option, value)
    assert reduce(getattr, place.split("."), changed) == value
    if option not in ("--task", "--preset"):  # of which others follow
        owner, _, its = place.rpartition(".")
        part = getattr(usual, owner) if owner else usual
        part = replace(part, **{its: value})
        assert changed == (replace(usual, **{owner: part}) if owner else part)


@pytest.mark.parametrize(
    ("options", "horizon"),
    [
        ((), 8),
        (("--rollout-windows", 100), 8),
        (("--rollout-windows", 12), 6),
        (("--rollout-windows", 1), 1),
        (("--rollout-windows", 12, "--credit-horizon", 12), 12),
        (("--discount", 0.75), 1),
        (("--credit", "team"), 1),
        (("--credit", "team", "--discount", 0), 1),
    ],
)
def test_the_horizon_of_credits_suits_rollouts_and_discount(options, horizon):
    assert asked(*options).ppo.horizon == horizon


@pytest.mark.parametrize(
    ("option", "value", "changes"),
    [
        ("--discount", 0.75, {"discount": 0.75, "horizon": 1}),
        ("--rollout-windows", 6, {"num_steps": 6, "horizon": 3}),
    ],
)
def test_options_that_the_horizon_follows_change_nothing_else(option, value, changes):
    usual = asked()
    assert asked(option, value) == replace(usual, ppo=replace(usual.ppo, **changes))


def test_missions_in_training_have_one_length_or_one_between_two():
    assert asked("--train-windows", 50).train_windows == (50,)
    assert asked("--train-windows", 50, 200).train_windows == (50, 200)


def test_features_bring_the_networks_inputs_along_and_presets_the_papers_way():
    training = asked("--features", "paper")
    assert (training.features, training.network.num_features) == ("paper", 8)
    assert asked("--linear").network.is_linear
    assert not asked().network.is_linear
    code = asked("--credit", "team", "--preset", "reference")
    assert (code.features, code.network.num_outputs) == ("reference", 2)
    assert code.mission.half_duplex == "eavesdroppers"


def test_robots_begin_more_silent_where_an_order_of_turns_lets_them_speak():
    assert asked("--features", "turns") == asked()
    for features in ("turns", "local", "paper"):
        assert asked("--features", features).silence_logit == 5.5 < ORDERLY_SILENCE
    assert asked("--features", "extended").silence_logit == ORDERLY_SILENCE
    assert asked("--features", "extended", "--silence-logit", 5).silence_logit == 5.0
    team = usual_settings("team", paper("stationary"), (40,))
    assert asked("--credit", "team", "--features", "paper") == team
    begun = tiny_config(tiny_network("local"), "local")
    assert asked_settings(given("--features", "local"), begun).silence_logit == 1.5


@pytest.mark.parametrize(
    ("sizes", "missions", "groups"),
    [((10,), 16, 4), ((10, 20), 16, 4), ((10, 20, 40), 18, 3), ((2, 3, 4, 5, 6), 20, 5)],
)
def test_sizes_share_the_missions_evenly(sizes, missions, groups):
    training = asked("--robots", *sizes, sizes[0])  # which counts once
    assert (training.robots, training.missions, training.groups) == (sizes, missions, groups)


def test_several_values_of_missions_multiply_and_share_the_missions_evenly():
    training = asked(
        *("--task", "stationary", "flocking", "--range-ratio", 0.5, 1.0, 0.5, "--robots", 10, 20),
        *("--fading", "none", "rayleigh"),
    )
    flown = [(each.task, each.range_ratio, each.fading) for each in training.all_missions]
    assert flown == [
        (task, range_ratio, fading)
        for task in ("stationary", "flocking")
        for range_ratio in (0.5, 1.0)
        for fading in ("none", "rayleigh")
    ]
    assert len(training.kinds) == training.missions == training.groups == 16
    assert training.credit_scaling == "kind"
    alone = asked("--task", "flocking", "--range-ratio", 1.0, "--fading", "rayleigh")
    assert training.all_missions[-1] == replace(alone.mission, num_robots=10)


def test_credits_are_scaled_where_missions_differ_or_as_asked():
    assert asked("--robots", 10, 20).credit_scaling == "none"
    assert asked("--range-ratio", 0.5, 1.0).credit_scaling == "kind"
    assert asked("--range-ratio", 0.5, 1.0, "--credit-scaling", "none").credit_scaling == "none"
    assert asked("--credit-scaling", "kind").credit_scaling == "kind"
    team = asked("--credit", "team", "--range-ratio", 0.5, 1.0)
    assert (team.credit_scaling, len(team.other_missions)) == ("none", 1)


def test_what_is_given_must_count_in_one_of_several_missions():
    asked("--fading", "none", "rician", "--rician-k", 3)
    with pytest.raises(ValueError, match="--rician-k counts only with --fading"):
        asked("--fading", "none", "rayleigh", "--rician-k", 3)


def test_groups_are_as_near_to_four_as_the_missions_allow():
    expected = {1: 1, 2: 2, 3: 3, 6: 3, 7: 7, 8: 4, 10: 5, 14: 2}
    assert {missions: asked("--missions", missions).groups for missions in expected} == expected


def test_a_policy_to_begin_with_brings_its_network():
    network = tiny_network("reference", num_outputs=2)
    config = tiny_config(network, "reference", most_speech=0.25)
    training = asked_settings(given("--latent", 6, "--seed", 3), config)
    assert training.network == config.network
    assert (training.features, training.silence_logit) == ("reference", 1.5)
    assert training.most_speech == 0.25
    assert asked_settings(given("--most-speech", 0.5), config).most_speech == 0.5
    with pytest.raises(ValueError, match="--depth 3 is not what the policy p has, 2; leave it"):
        asked_settings(given("--depth", 3), config, Path("p"))


def test_a_run_that_goes_on_has_its_own_settings():
    training = asked("--latent", 5)
    refuse_others(given("--latent", 5, "--robots", 40), training, "the run")
    several = asked("--range-ratio", 0.5, 1.0)
    refuse_others(given("--range-ratio", 0.5, 1.0), several, "the run")
    with pytest.raises(ValueError, match=r"--range-ratio 0\.5 is not what the run has"):
        refuse_others(given("--range-ratio", 0.5), several, "the run")
    with pytest.raises(ValueError, match="--credit team is not what the run has, robot; leave it"):
        refuse_others(given("--credit", "team"), training, "the run")


NEW, STORED = Limits(decisions=ROBOT.budget), Limits(decisions=5, minutes=1.0, replay_every=3)


@pytest.mark.parametrize(
    ("stored", "asked", "limits"),
    [
        (NEW, (), Limits(decisions=200_000)),
        (NEW, ("--budget", 5), Limits(decisions=5)),
        (NEW, ("--minutes", 2.0), Limits(minutes=2.0)),
        (NEW, ("--budget", 5, "--minutes", 2.0), Limits(decisions=5, minutes=2.0)),
        (STORED, (), STORED),
        (STORED, ("--minutes", 2.0, "--replay-every", 9), Limits(minutes=2.0, replay_every=9)),
    ],
)
def test_a_run_stops_as_before_or_as_asked_now(stored, asked, limits):
    assert asked_limits(stored, options(*asked)) == limits
