"""The planner's numbers: each one is read, none is misspelt, and they make sense together."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from swarm_mj.policies.planner import settings
from swarm_mj.policies.planner.settings import PlannerSettings

SETTINGS = PlannerSettings()
HERE = Path(settings.__file__)
READERS = "".join(path.read_text() for path in HERE.parent.glob("*.py") if path != HERE)
NUMBERS = [(group.name, each.name) for group in fields(SETTINGS) for each in fields(group.type)]


@pytest.mark.parametrize(("group", "name"), NUMBERS)
def test_the_planner_reads_every_number(group, name):
    assert isinstance(getattr(getattr(SETTINGS, group), name), int | float)
    assert re.search(rf"\.{name}\b", READERS)


def test_a_robot_is_missing_before_it_is_planned_without():
    snapshots, schedule = SETTINGS.snapshots, SETTINGS.schedule
    for num_robots in (2, 10, 40, 200):
        missing = max(snapshots.fresh_rounds * num_robots, snapshots.min_fresh_windows)
        gone = schedule.gone_rounds * max(num_robots, schedule.min_round_windows)
        assert missing < gone


def test_the_first_epochs_are_over_before_the_search_begins():
    epochs, search = SETTINGS.epochs, SETTINGS.search
    assert epochs.early_rounds < epochs.regular_rounds < epochs.first_rounds
    assert epochs.min_early_windows < epochs.min_regular_windows
    assert epochs.first_rounds + 2 * epochs.early_rounds < search.start_rounds


@pytest.mark.parametrize("num_robots", [2, 8, 20, 40, 100])
def test_tables_of_links_have_time_to_spread_between_learning_and_flying(num_robots):
    """And the first is made after a round, in which everyone took its turn."""
    learning = SETTINGS.learning
    slots = 2 * max(num_robots, learning.min_round_windows)
    first, flown, spread = (
        round(rounds * slots)
        for rounds in (learning.first_rounds, learning.flown_rounds, learning.spread_rounds)
    )
    assert 0 < spread < flown <= first - spread
    assert first - spread > 2 * num_robots
    assert learning.cautious_stds <= learning.disturbing_stds
