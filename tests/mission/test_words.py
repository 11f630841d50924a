import pytest

from swarm_mj.mission import paper
from swarm_mj.mission.words import bodies_in_words, robots_in_words


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "40 robots"),
        ({"robot": "rover", "num_robots": 6}, "6 rovers"),
        ({"robot": "quadrotor:1,rover:2", "num_robots": 3}, "1 quadrotor and 2 rovers"),
        (
            {"robot": "a/my.xml:2,rover:2,quadrotor:3", "num_robots": 7},
            "2 robots of a/my.xml, 2 rovers and 3 quadrotors",
        ),
    ],
)
def test_robots_are_counted_by_their_kind(given, said):
    assert robots_in_words(paper(**given)) == said


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, []),
        ({"robot": "quadrotor"}, ["at 20 m"]),
        (
            {"robot": "quadrotor", "height_m": 5.0, "height_range_m": 2.0, "wind_mps": 30.0},
            ["at 5 m", "to 2 m higher", "wind 30 m/s"],
        ),
        ({"robot": "rover"}, []),  # it stays on the floor
        ({"robot": "rover", "gust_mps": 2.0}, ["gusts 2 m/s"]),
        ({"robot": "rover:39,quadrotor:1"}, ["at 20 m"]),
    ],
)
def test_bodies_are_said_to_be_where_they_are(given, said):
    mission = paper(**given)
    assert bodies_in_words(mission.robot, vars(mission)) == said


def test_what_an_older_file_lacks_is_not_said():
    assert bodies_in_words("quadrotor", {"height_m": None, "wind_mps": 3.0}) == ["wind 3 m/s"]
