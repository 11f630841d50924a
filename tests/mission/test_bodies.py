import pytest

from swarm_mj.mission import Mission, paper
from swarm_mj.mission.bodies import RobotGroup, can_fly
from swarm_mj.physics.robots import SHIPPED, kinds_of


def test_points_have_two_axes_and_bodies_three():
    assert paper().num_axes == 2
    assert paper(robot="quadrotor").num_axes == 3


def test_a_kind_that_stands_alone_is_the_whole_team():
    assert paper(robot="rover", num_robots=7).groups == [RobotGroup("rover", 7)]


def test_several_kinds_share_the_team_in_order():
    groups = paper(robot="quadrotor:3,rover:2", num_robots=5).groups
    assert groups == [RobotGroup("quadrotor", 3), RobotGroup("rover", 2)]


def test_a_preset_moves_bodies_by_forces():
    assert paper(robot="quadrotor").physics == "contact"


@pytest.mark.parametrize(
    ("robot", "flies"),
    [
        ("point", False),
        ("rover:2,rover:3", False),
        ("rover:2,quadrotor:3", True),
        ("rover:3,mine.xml:2", True),
    ],
)
def test_a_team_flies_if_some_of_it_may(robot, flies):
    assert can_fly(robot) == flies


@pytest.mark.parametrize("robot", SHIPPED)
def test_the_packages_robots_fly_if_their_models_do(robot):
    (kind,) = kinds_of(paper(robot=robot))
    assert can_fly(robot) == kind.is_free


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"robot": "quadrotor:3"}, "are 3 robots, but the team has 40"),
        ({"robot": "quadrotor:3,rover"}, "kinds with their numbers"),
        ({"robot": "quadrotor:0,rover:40"}, "kinds with their numbers"),
        ({"robot": "point:20,rover:20"}, "none of them a point"),
        ({"robot": "quadrotor", "physics": "exact"}, "choose physics contact"),
        ({"wind_mps": -1.0}, r"wind must be a number from 0 to 50 \[m/s\], not -1"),
    ],
)
def test_what_is_no_team_of_bodies_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        Mission(**given)
