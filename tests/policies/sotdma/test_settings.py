import pytest

from swarm_mj.policies.sotdma.settings import SotdmaSettings


@pytest.mark.parametrize(
    ("num_robots", "num_slots"), [(2, 2), (5, 5), (10, 10), (20, 14), (40, 20), (80, 29)]
)
def test_frames_grow_with_the_root_of_the_team_and_are_never_longer_than_a_round(
    num_robots, num_slots
):
    assert SotdmaSettings().frame_slots(num_robots) == num_slots
