"""What is said of the policy that a run kept."""

from dataclasses import replace
from pathlib import Path

import pytest

from swarm_mj.cli.train_report import has_stopped_early, report, verdicts
from swarm_mj.learning.choice import Choice, Cost
from swarm_mj.learning.run_folder import Limits, Progress, Run
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import paper

RUN = Run(
    training=usual_settings("robot", paper("stationary"), (40,)),
    limits=Limits(decisions=200_000, patience=2),
)
FIRST = {"decisions": 0.0, "aoi": 48.0, "objective": 1.2, "aoi_tdma": 25.0}
FIRST |= {"aoi_greedy_oracle": 12.0}
BEST = FIRST | {"decisions": 10_000.0, "aoi": 21.5, "aoi_sem": 0.4, "objective": 0.5}
CHOICE = Choice(
    decisions=10_000,
    run_decisions=20_000,
    num_finalists=2,
    num_missions=32,
    kept=Cost(mean=22.25, sem=0.5),
    others={
        "tdma": Cost(mean=25.0, sem=0.75, behind=-2.75, behind_sem=0.25),
        "spatial-tdma": Cost(mean=21.0, sem=0.5, behind=1.25, behind_sem=0.5),
        "first": Cost(mean=48.0, sem=None, behind=-25.75, behind_sem=None),
    },
)


def progress(choice=CHOICE, *rows):
    return Progress(decisions=20_000, curve=[FIRST, BEST, *rows], choice=choice)


def test_the_policy_kept_stands_beside_others_with_what_they_know():
    rows = report(RUN, progress())
    assert rows["missions"] == "32 of each team size, which chose nothing"
    assert rows["policy kept"] == "22.25 ± 0.50 windows, after 10,000 decisions"
    assert rows["tdma"] == "25.00 ± 0.75 windows; robots take turns that were agreed beforehand"
    assert rows["the policy it began with"] == "48.00 windows"
    assert rows["greedy-oracle"].startswith(
        "12.00 windows, on 4 of 12 missions of the evaluations; knows"
    )


def test_losses_are_said_and_wins_are_not_boasted_of():
    (said,) = verdicts(RUN, progress())
    assert said == (
        "The policy kept loses to spatial-tdma by 1.25 ± 0.50 windows on the same missions."
    )


def test_a_difference_within_its_error_is_no_loss():
    level = {"spatial-tdma": replace(CHOICE.others["spatial-tdma"], behind=0.75)}
    (said,) = verdicts(RUN, progress(replace(CHOICE, others=level)))
    assert said.startswith("The policy kept is no better than spatial-tdma, which is ahead by 0.75")


def test_one_mission_is_too_few_to_lose():
    """Without an error, nobody knows what is for chance."""
    one = {"tdma": Cost(mean=20.0, sem=None, behind=9.0, behind_sem=None)}
    (said,) = verdicts(RUN, progress(replace(CHOICE, others=one)))
    assert said.startswith("The policy kept is no better than tdma, which is ahead by 9.00 windows")


def test_an_oracle_that_has_not_flown_is_said():
    large = replace(RUN, training=replace(RUN.training, robots=(40, 200)))
    row = {name: x for name, x in FIRST.items() if name != "aoi_greedy_oracle"}
    for choice in (CHOICE, None):
        rows = report(large, Progress(decisions=20_000, curve=[row], choice=choice))
        assert rows["greedy-oracle"].startswith("not flown: it would take long with more than 100")
    assert "greedy-oracle" not in report(RUN, Progress(decisions=20_000, curve=[row]))


@pytest.mark.parametrize(
    ("init", "name"), [(None, "the untrained policy"), ("runs/x/policy", "the policy given")]
)
def test_a_training_that_did_not_help_is_said(init, name):
    said = verdicts(replace(RUN, init=init and Path(init)), progress(replace(CHOICE, decisions=0)))
    assert said[0].startswith(f"Training did not help: {name}")


def test_an_early_stop_is_said_with_the_way_on():
    stalled = progress(CHOICE, BEST | {"decisions": 15_000.0}, BEST | {"decisions": 20_000.0})
    assert has_stopped_early(RUN, stalled)
    said = verdicts(RUN, stalled)[0]
    assert said.startswith("Stopped early: the last 2 evaluations brought no gain.")
    assert "--patience 0 trains on" in said
    for not_chosen in (None, replace(CHOICE, run_decisions=15_000)):
        assert "--patience" not in verdicts(RUN, replace(stalled, choice=not_chosen))[0]
    assert not has_stopped_early(RUN, progress())
    done = replace(RUN, limits=replace(RUN.limits, decisions=20_000))
    assert not has_stopped_early(done, stalled)


def test_an_interrupted_run_says_that_its_age_flatters():
    rows = report(RUN, progress(None))
    assert rows["missions"] == "12 of each team size, which chose the policy"
    assert rows["policy kept"] == "21.50 ± 0.40 windows, after 10,000 decisions"
    assert rows["tdma"].startswith("25.00 windows; ")
    assert rows["greedy-oracle"].startswith("12.00 windows, on 4 of 12 missions")
    assert "flatters" in verdicts(RUN, progress(None))[0]
    assert report(RUN, Progress()) == {}
    assert verdicts(RUN, Progress()) == []


def test_flocks_are_judged_by_their_velocity_variance():
    mission = paper("flocking")
    training = replace(usual_settings("team", mission, (40,)), reward="velocity-variance")
    rows = report(replace(RUN, training=training), progress())
    assert rows["policy kept"] == "22.2500 ± 0.5000 m²/s², after 10,000 decisions"
