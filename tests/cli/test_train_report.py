"""The bar of a training run, a line for every evaluation, and the report at its end."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from swarm_mj.cli.train_report import (
    Watch,
    has_stopped_early,
    report,
    share_done,
    verdicts,
)
from swarm_mj.learning.run_folder import Limits, TrainingRun
from swarm_mj.learning.selection import Choice, Cost, CurveRow, HeldOutCosts, Progress, Status
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import paper

RUN = TrainingRun(
    training=usual_settings("robot", paper("stationary"), (40,)),
    limits=Limits(decisions=200_000, patience=2),
)


def evaluation(decisions, minutes=0.0, references=None, **its):
    """One of an age and an objective; its other costs are of no interest."""
    others = ("aoi_steady", "velocity_variance", "packets_per_window", "delivery_ratio")
    costs = HeldOutCosts(**dict.fromkeys(others, 0.5), **its)
    return CurveRow(decisions=decisions, minutes=minutes, costs=costs, references=references or {})


FLOWN = {"aoi_tdma": 25.0, "aoi_lookahead_oracle": 12.0}
FIRST = evaluation(0, references=FLOWN, aoi=48.0, objective=1.2)
BEST = evaluation(10_000, 1.46, FLOWN, aoi=21.5, aoi_sem=0.4, objective=0.5)
CHOICE = Choice(
    decisions=10_000,
    run_decisions=20_000,
    num_finalists=2,
    num_missions=32,
    kept=Cost(mean=22.25, sem=0.5),
    others={
        "tdma": Cost(mean=25.0, sem=0.75, behind=-2.75, behind_sem=0.25),
        "spatial-tdma": Cost(mean=21.0, sem=0.5, behind=1.25, behind_sem=0.5),
        "lookahead-oracle": Cost(mean=12.0, sem=0.25, behind=10.25, behind_sem=0.5),
        "first": Cost(mean=48.0, sem=None, behind=-25.75, behind_sem=None),
    },
)


def progress(choice=CHOICE, *rows):
    return Progress(decisions=20_000, curve=[FIRST, BEST, *rows], choice=choice)


def test_the_policy_kept_stands_beside_others_with_what_they_know():
    assert report(RUN, Progress()) == {}
    rows = report(RUN, progress())
    oracle = rows.pop("lookahead-oracle")
    assert oracle.startswith("12.00 ± 0.25 windows; knows where")
    assert oracle.endswith("; not reached on held-out missions")
    assert rows.pop("spatial-tdma").endswith("share a turn")  # it has no held-out flights
    assert rows == {
        "missions": "32 of each team size, not used to select the policy",
        "policy kept": "22.25 ± 0.50 windows, after 10,000 decisions",
        "tdma": "25.00 ± 0.75 windows; robots take turns that were agreed beforehand; "
        "reached on held-out missions in 1.5 min, 10,000 decisions",
        "the policy it began with": "48.00 windows",
    }


def test_a_reference_is_reached_by_the_first_evaluation_that_is_no_older():
    later = replace(BEST, decisions=20_000, minutes=3.0)
    assert "missions in 1.5 min, 10,000 decisions" in report(RUN, progress(CHOICE, later))["tdma"]
    as_old = replace(BEST, costs=replace(BEST.costs, aoi=25.0))
    older = replace(BEST, costs=replace(BEST.costs, aoi=25.01))
    found = Progress(decisions=20_000, curve=[FIRST, older, replace(as_old, minutes=2.0)])
    assert report(RUN, found)["tdma"].endswith(
        "; reached on held-out missions in 2.0 min, 10,000 decisions"
    )
    found = Progress(decisions=20_000, curve=[FIRST, older])
    assert report(RUN, found)["tdma"].endswith("; not reached on held-out missions")
    found = Progress(curve=[replace(FIRST, costs=as_old.costs)])
    assert report(RUN, found)["tdma"].endswith("; reached on held-out missions before training")


@pytest.mark.parametrize(
    ("others", "verdict"),
    [
        (CHOICE.others, "loses to spatial-tdma by 1.25 ± 0.50 windows"),
        (
            {"tdma": Cost(mean=21.0, sem=0.5, behind=0.75, behind_sem=0.5)},
            "shows no significant difference from tdma (0.75 ± 0.50 windows)",
        ),
        (
            {"tdma": Cost(mean=22.5, sem=0.5, behind=-0.25, behind_sem=0.5)},
            "shows no significant difference from tdma (-0.25 ± 0.50 windows)",
        ),
        (  # one mission is too few to lose
            {"tdma": Cost(mean=20.0, sem=None, behind=9.0, behind_sem=None)},
            "differs from tdma by 9.00 windows, in a single mission",
        ),
    ],
)
def test_losses_beyond_their_error_are_said_and_wins_are_not_boasted_of(others, verdict):
    (said,) = verdicts(RUN, progress(replace(CHOICE, others=others)))
    assert said == f"The policy kept {verdict} on the same missions."
    assert list(verdicts(RUN, Progress())) == []


@pytest.mark.parametrize("oracle", ["lookahead-oracle", "greedy-oracle"])
def test_nobody_is_expected_to_reach_an_oracle(oracle):
    """Runs that began with 1.0 have flown the greedy one."""
    far = Cost(mean=5.0, sem=0.5, behind=20.0, behind_sem=0.5)
    assert list(verdicts(RUN, progress(replace(CHOICE, others={oracle: far})))) == []


def test_an_oracle_that_has_not_flown_is_said():
    large = replace(RUN, training=replace(RUN.training, robots=(40, 200)))
    row = replace(FIRST, references={"aoi_tdma": 25.0})
    others = {"tdma": CHOICE.others["tdma"]}
    for choice in (replace(CHOICE, others=others), None):
        rows = report(large, Progress(decisions=20_000, curve=[row], choice=choice))
        said = "not flown: it would take long with more than 100"
        assert rows["lookahead-oracle"].startswith(said)
    assert "lookahead-oracle" not in report(RUN, Progress(decisions=20_000, curve=[row]))


@pytest.mark.parametrize(
    ("init", "name"), [(None, "the untrained policy"), ("runs/x/policy", "the policy given")]
)
def test_a_training_that_did_not_help_is_said(init, name):
    run = replace(RUN, init=init and Path(init))
    said, *_ = verdicts(run, progress(replace(CHOICE, decisions=0)))
    assert said.startswith(f"Training did not help: {name}")


def test_an_early_stop_is_said_with_the_way_on():
    stalled = progress(CHOICE, replace(BEST, decisions=15_000), replace(BEST, decisions=20_000))
    assert has_stopped_early(RUN, stalled)
    said = next(verdicts(RUN, stalled))
    assert said.startswith("Stopped early: the last 2 evaluations brought no gain.")
    assert "--patience 0 trains on" in said
    for not_chosen in (None, replace(CHOICE, run_decisions=15_000)):
        assert "--patience" not in next(verdicts(RUN, replace(stalled, choice=not_chosen)))
    assert not has_stopped_early(RUN, progress())
    done = replace(RUN, limits=replace(RUN.limits, decisions=20_000))
    assert not has_stopped_early(done, stalled)


def test_an_interrupted_run_says_that_its_age_is_biased():
    rows = report(RUN, progress(None))
    assert rows["missions"] == "12 of each team size, which selected the policy"
    assert rows["policy kept"] == "21.50 ± 0.40 windows, after 10,000 decisions"
    assert rows["tdma"].startswith("25.00 windows; ")
    assert rows["lookahead-oracle"].startswith("12.00 windows; knows")
    assert "biased" in next(verdicts(RUN, progress(None)))


def test_flocks_are_judged_by_their_velocity_variance():
    training = replace(usual_settings("team", paper("flocking"), (40,)), reward="velocity-variance")
    rows = report(replace(RUN, training=training), progress())
    assert rows["policy kept"] == "22.2500 ± 0.5000 m²/s², after 10,000 decisions"


SHORT = replace(RUN, limits=Limits(decisions=4_000))
ROW = evaluation(1000, 0.5, aoi=31.5, aoi_sem=0.25, objective=1.0)


def at(decisions, minutes, curve=()):
    return Progress(decisions=decisions, minutes=minutes, curve=list(curve))


def test_the_share_done_is_by_the_nearest_limit():
    for decisions, minutes, share in (
        (4_000, None, 0.25),
        (None, 10.0, 0.2),
        (4_000, 10.0, 0.25),
        (8_000, 10.0, 0.2),
        (500, None, 1.0),
    ):
        limits = Limits(decisions=decisions, minutes=minutes)
        assert share_done(at(1_000, 2.0), limits) == pytest.approx(share)


def heard_by(is_interrupted, statuses, terminal=False):
    """What is drawn for these, each at its minute, and whether each asked to go on."""
    file, now_s = io.StringIO(), [0.0]
    console = Console(
        file=file,
        force_terminal=terminal,
        color_system=None,
        width=120,
        soft_wrap=True,
        get_time=lambda: now_s[0],
    )
    answers = []
    with Watch(console, SHORT, is_interrupted) as watch:
        for each in statuses:
            now_s[0] = 60.0 * each.progress.minutes
            answers.append(watch(each))
    return file.getvalue(), answers, watch


def test_every_new_evaluation_is_a_line_and_those_of_earlier_sessions_are_not():
    worse = evaluation(2000, 0.5, aoi=35.0, aoi_sem=0.25, objective=2.0)
    flown = {
        "aoi_spatial_tdma": 21.0,
        "aoi_lookahead_oracle": 12.0,
        "aoi_behind_spatial_tdma": 4.0,
        "aoi_behind_spatial_tdma_sem": 1.25,
        "aoi_behind_lookahead_oracle": -0.5,
    }
    better = evaluation(3000, 0.5, flown, aoi=25.0, aoi_sem=0.25, objective=0.5)
    curves = ([ROW], [ROW, worse], [ROW, worse], [ROW, worse, better])
    statuses = [
        Status(progress=at(1_000 * n, float(n), curve)) for n, curve in enumerate(curves, start=1)
    ]
    shown, answers, _ = heard_by(lambda: False, statuses)
    first, second = (" ".join(line.split()) for line in shown.splitlines())
    assert first == "2,000 decisions 0.5 min held-out age 35.00 ± 0.25"
    assert second.startswith("3,000 decisions 0.5 min held-out age 25.00 ± 0.25 best so far ")
    compared = "spatial-tdma 21.00 (+4.00 ± 1.25) lookahead-oracle 12.00 (-0.50)"
    assert second.endswith(f" best so far {compared}")
    assert answers == [True] * 4


def test_the_bar_says_where_the_run_stands_and_what_is_evaluated():
    statuses = [
        Status(progress=at(1_000, 1.0, [ROW])),
        Status(progress=at(2_000, 2.0, [ROW]), aoi=28.0),
        Status(progress=at(2_000, 2.0, [ROW]), evaluated=0.4, what="Choosing"),
    ]
    shown, _, _ = heard_by(lambda: False, statuses[:2], terminal=True)
    assert "Training" in shown
    assert "2,000 decisions, age 28.0, held out 31.5 0:02:00" in shown
    shown, _, _ = heard_by(lambda: False, statuses, terminal=True)
    assert "Choosing" in shown
    assert "missions 40%" in shown


def test_ctrl_c_is_passed_on_and_said_once():
    shown, answers, watch = heard_by(
        lambda: True, [Status(progress=at(n, float(n))) for n in (1, 2)]
    )
    assert answers == [False, False]
    assert watch.has_stopped
    assert shown.count("Interrupted: finishing this rollout") == 1


def test_ctrl_c_shows_in_the_bar_before_the_run_is_heard_of_again():
    file, pressed = io.StringIO(), []
    console = Console(file=file, force_terminal=True, width=100)
    with Watch(console, SHORT, lambda: bool(pressed)) as watch:
        watch(Status(progress=at(1, 1.0)))
        pressed.append(1)
        watch._bar.refresh()
        assert "Finishing" in file.getvalue()
    assert not watch.has_stopped
