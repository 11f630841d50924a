"""A flight is compiled before it is timed."""

from swarm_mj.api.flight import COMPILING_WINDOWS, compile_ahead
from swarm_mj.mission import paper

MISSION = paper("stationary", num_robots=3, num_windows=4, range_ratio=5.0)


def test_a_small_mission_is_flown_ahead_also_for_a_policy_of_one_s_own():
    windows = []
    compile_ahead(MISSION, "nowhere:Mine", lambda: windows.append(1), probability=0.2)
    assert len(windows) == COMPILING_WINDOWS
