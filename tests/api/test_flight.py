"""What is said of a flight, however it ended."""

import pytest

from swarm_mj.api.flight import COMPILING_WINDOWS, Flown, compile_ahead, flight_summary
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.exit_codes import DONE, FAILED, INTERRUPTED

MISSION = paper("stationary", num_robots=3, num_windows=4, range_ratio=5.0)


@pytest.mark.parametrize("code", [DONE, FAILED, INTERRUPTED])
def test_a_flight_that_ended_early_is_called_interrupted(code):
    policy = make_policy("tdma", MISSION)
    windows = list(rollout(Swarm(MISSION, [1]), policy))
    told = flight_summary(paper("stationary"), policy, Flown(windows, code, "", 2.5))
    assert (told["num_windows"], told["wall_seconds"]) == (4, 2.5)
    assert told["interrupted"] == (code != DONE)


def test_a_small_mission_is_flown_ahead_also_for_a_policy_of_one_s_own():
    windows = []
    compile_ahead(MISSION, "nowhere:Mine", lambda: windows.append(1), probability=0.2)
    assert len(windows) == COMPILING_WINDOWS
