"""The planner's numbers: each one is read, none is misspelt, and they make sense together."""

import re
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import pytest

from swarm_mj.policies.planner import settings
from swarm_mj.policies.planner.settings import (
    DiscoverySettings,
    PlannerSettings,
    WeightSettings,
)

SETTINGS = PlannerSettings()
HERE = Path(settings.__file__)
READERS = "".join(path.read_text() for path in HERE.parent.glob("*.py") if path != HERE)
NUMBERS = [(group.name, each.name) for group in fields(SETTINGS) for each in fields(group.type)]


@pytest.mark.parametrize(("group", "name"), NUMBERS)
def test_the_planner_reads_every_number(group, name):
    assert isinstance(getattr(getattr(SETTINGS, group), name), int | float)
    assert re.search(rf"\.{name}\b", READERS)


def test_a_number_that_the_planner_has_not_is_refused():
    with pytest.raises(TypeError, match="max_transmiters"):
        DiscoverySettings(max_transmiters=8)
    with pytest.raises(FrozenInstanceError):
        SETTINGS.search.every_windows = 1


def test_groups_of_two_planners_are_the_same_numbers_and_one_is_changed_alone():
    changed = PlannerSettings(weights=WeightSettings(max_share=2.0))
    assert changed != SETTINGS == PlannerSettings()
    assert changed.weights.share_unlinked == SETTINGS.weights.share_unlinked
    assert changed.schedule == SETTINGS.schedule


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
