"""Standing plans: whatever is asked of them, they are one schedule, worked out in one go."""

import numpy as np
import pytest
from learning_reference import planned

from swarm_mj.mission import paper
from swarm_mj.policies.planner.settings import PlannerSettings, ScheduleSettings
from swarm_mj.policies.planner.standing_plan import StandingPlan
from swarm_mj.radio.decode_curves import decode_curves
from swarm_mj.radio.links import doubtful, links_between
from swarm_mj.radio.mission_radio import radio_of

SETTINGS = PlannerSettings()


def links_of(*, is_doubtful=False):
    position_m = np.random.default_rng(2).uniform(-350.0, 350.0, (8, 2))
    links = links_between(radio_of(paper("stationary")), position_m)
    return doubtful(links, decode_curves(), np.full((8, 8), 2.0)) if is_doubtful else links


@pytest.mark.parametrize("is_doubtful", [False, True])
@pytest.mark.parametrize("chunk_slots", [1, 7, 10])
def test_chunks_make_one_plan(chunk_slots, is_doubtful):
    links = links_of(is_doubtful=is_doubtful)
    settings = PlannerSettings(schedule=ScheduleSettings(chunk_slots=chunk_slots))
    plan = StandingPlan(links, settings)
    made = [plan.transmits(slot).copy() for slot in range(30)]
    np.testing.assert_array_equal(made, planned(links, SETTINGS, 30))
    assert np.all(np.any(made, axis=0))  # everyone has its say


def test_a_plan_begins_with_its_first_slot_whenever_that_is():
    links = links_of()
    early, late = StandingPlan(links, SETTINGS), StandingPlan(links, SETTINGS, 70)
    for slot in range(25):
        np.testing.assert_array_equal(late.transmits(70 + slot), early.transmits(slot))


def test_who_joins_late_finds_the_plan_that_the_others_fly():
    links = links_of()
    asked, joined = StandingPlan(links, SETTINGS, 4), StandingPlan(links, SETTINGS, 4)
    rows = [asked.transmits(slot) for slot in range(4, 40)]
    np.testing.assert_array_equal(joined.transmits(33), rows[33 - 4])
    np.testing.assert_array_equal(joined.last, rows[33 - 4])
    np.testing.assert_array_equal(joined.transmits(20), rows[20 - 4])
    np.testing.assert_array_equal(joined.last, rows[20 - 4])
