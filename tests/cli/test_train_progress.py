"""What is shown of a run: its share, its time left, a line for every evaluation."""

import io
import math

import pytest
from rich.console import Console

from swarm_mj.cli.train_progress import Watch, age_of, minutes_left, share_done
from swarm_mj.learning.callback import Status
from swarm_mj.learning.run_folder import Limits, Progress, Run
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import paper

RUN = Run(
    training=usual_settings("robot", paper("stationary"), (40,)), limits=Limits(decisions=4_000)
)
ROW = {"decisions": 1000.0, "minutes": 0.5, "aoi": 31.5, "aoi_sem": 0.25, "objective": 1.0}


def status(decisions, minutes, curve=(), evaluated=None, aoi=math.nan, what="Training"):
    return Status(
        decisions=decisions,
        minutes=minutes,
        aoi=aoi,
        progress=Progress(curve=list(curve)),
        evaluated=evaluated,
        what=what,
    )


@pytest.mark.parametrize(
    ("limits", "share"),
    [
        (Limits(decisions=4_000), 0.25),
        (Limits(minutes=10.0), 0.2),
        (Limits(decisions=4_000, minutes=10.0), 0.25),
        (Limits(decisions=8_000, minutes=10.0), 0.2),
        (Limits(decisions=500), 1.0),
    ],
)
def test_the_share_done_is_by_the_nearest_limit(limits, share):
    assert share_done(status(1_000, 2.0), limits) == pytest.approx(share)


def test_the_time_left_is_by_this_sessions_speed():
    """A session that began at 1000 decisions makes 500 a minute, whatever those before made."""
    start, now = status(1_000, 60.0), status(2_000, 62.0)
    assert minutes_left(now, start, Limits(decisions=3_500)) == pytest.approx(3.0)
    assert minutes_left(now, start, Limits(minutes=64.0)) == pytest.approx(2.0)
    assert minutes_left(now, start, Limits(decisions=3_500, minutes=64.0)) == pytest.approx(2.0)
    assert minutes_left(start, start, Limits(decisions=3_500)) is None
    assert minutes_left(now, start, Limits(decisions=1_500)) == 0.0


def test_an_age_has_its_error_if_it_has_one():
    assert age_of(ROW) == "31.50 ± 0.25"
    assert age_of({"aoi": 31.5}) == "31.50"


def heard_by(is_interrupted, statuses, terminal=False):
    """What is drawn for these, and whether each asked to go on."""
    file = io.StringIO()
    console = Console(file=file, force_terminal=terminal, width=120, soft_wrap=True)
    with Watch(console, RUN, is_interrupted) as watch:
        answers = [watch(each) for each in statuses]
    return file.getvalue(), answers, watch


def test_every_new_evaluation_is_a_line_and_those_of_earlier_sessions_are_not():
    worse = ROW | {"decisions": 2000.0, "aoi": 35.0, "objective": 2.0}
    better = (
        ROW
        | {"aoi_spatial_tdma": 21.0, "aoi_greedy_oracle": 12.0}
        | {"decisions": 3000.0, "aoi": 25.0, "objective": 0.5}
    )
    shown, answers, _ = heard_by(
        lambda: False,
        [
            status(1_000, 1.0, [ROW]),
            status(2_000, 2.0, [ROW, worse]),
            status(2_100, 2.1, [ROW, worse]),
            status(3_000, 3.0, [ROW, worse, better]),
        ],
    )
    first, second = (" ".join(line.split()) for line in shown.splitlines())
    assert first == "2,000 decisions 0.5 min held-out age 35.00 ± 0.25"
    assert second.startswith("3,000 decisions 0.5 min held-out age 25.00 ± 0.25 best so far ")
    assert second.endswith(" best so far spatial-tdma 21.00 greedy-oracle 12.00 (4 of 12 missions)")
    assert answers == [True] * 4


def test_the_bar_says_where_the_run_stands():
    shown, _, _ = heard_by(
        lambda: False,
        [status(1_000, 1.0, [ROW]), status(2_000, 2.0, [ROW], aoi=28.0)],
        terminal=True,
    )
    assert "Training" in shown
    assert "2,000 decisions, age 28.0, held out 31.5, 17/s, 0:02:00 left" in shown


def test_the_bar_says_that_missions_are_evaluated():
    shown, _, _ = heard_by(lambda: False, [status(0, 0.1, evaluated=0.4, what="Choosing")], True)
    assert "Choosing" in shown
    assert "missions 40%" in shown


def test_ctrl_c_is_passed_on_and_said_once():
    shown, answers, watch = heard_by(lambda: True, [status(1, 1.0), status(2, 2.0)])
    assert answers == [False, False]
    assert watch.has_stopped
    assert shown.count("Interrupted: finishing this rollout") == 1


def test_ctrl_c_shows_in_the_bar_before_the_run_is_heard_of_again():
    pressed = []
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=100)
    with Watch(console, RUN, lambda: bool(pressed)) as watch:
        watch(status(1, 1.0))
        pressed.append(1)
        watch._bar.refresh()
        assert "Finishing" in file.getvalue()
    assert not watch.has_stopped
