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


def test_the_planner_reads_every_number():
    names = [each.name for each in fields(SETTINGS)]
    assert [name for name in names if not re.search(rf"\.{name}\b", READERS)] == []


@pytest.mark.parametrize("num_robots", [2, 8, 20, 40, 200])
def test_numbers_make_sense_together(num_robots):
    """A robot is missing before it is planned without; the first epochs are over before the search
    begins; tables of links have time to spread, and the first is made after a round of turns."""
    missing = max(SETTINGS.fresh_rounds * num_robots, SETTINGS.min_fresh_windows)
    round_windows = max(num_robots, SETTINGS.min_round_windows)
    assert missing < SETTINGS.gone_rounds * round_windows
    assert SETTINGS.early_epoch_rounds < SETTINGS.epoch_rounds < SETTINGS.first_epoch_rounds
    assert SETTINGS.min_early_epoch_windows < SETTINGS.min_epoch_windows
    assert SETTINGS.first_epoch_rounds + 2 * SETTINGS.early_epoch_rounds < SETTINGS.search_rounds
    first, flown, spread = (
        round(rounds * 2 * round_windows)
        for rounds in (SETTINGS.first_table_rounds, SETTINGS.flown_rounds, SETTINGS.spread_rounds)
    )
    assert 0 < spread < flown <= first - spread
    assert first - spread > 2 * num_robots
    assert SETTINGS.cautious_stds <= SETTINGS.disturbing_stds
