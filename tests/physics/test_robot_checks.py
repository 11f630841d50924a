"""Models that are no robot of a team, each refused in a line that names what is wrong."""

from functools import partial

import pytest
from robot_files import (
    APART,
    BODY,
    FAR,
    LIFT,
    PLANAR,
    declaring,
    mjcf,
    with_antenna,
    written,
)

from swarm_mj import paper
from swarm_mj.physics.robots import kinds_of


@pytest.fixture
def own(tmp_path):
    """Writes a robot's file; returns its name."""
    return partial(written, tmp_path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco><worldbody>", "not well-formed XML"),
        (mjcf(body=BODY.replace("<freejoint/>", "")), "neither free nor on a plane"),
        (mjcf(body=BODY.replace("<freejoint/>", '<joint type="ball"/>')), "neither free nor on"),
        (mjcf(body=BODY + BODY.replace("base", "b2").replace('"s"', '"t"')), "it has 2 bodies"),
        (mjcf(actuator=""), "it has no actuator"),
        (mjcf(body=BODY.replace("<geom", '<geom contype="0" conaffinity="0"')), "that collides"),
        (mjcf(body=PLANAR.replace('pos="0 0 0.1"', 'pos="1 0 0.1"')), "must begin at x = y = 0"),
        (mjcf(option='<option timestep="0.02"/>'), "its timestep must be from 0.0005 to 0.01 s"),
        (mjcf(actuator=LIFT.replace('"s"', '"gone"')), "gone"),
        (mjcf(body=BODY.replace('mass="0.2"', 'mass="nan"')), "nan in mass"),
        (mjcf(body='<site name="w"/>' + BODY, actuator=LIFT + FAR), "sensor of what is not in its"),
        (mjcf(body='<site name="w"/>' + BODY, actuator=LIFT + APART), "sensor of what is not in"),
        (mjcf(body=with_antenna("0.1 0 0.3")), r"right above or below its base.*\(0.1, 0, 0.3\) m"),
        (mjcf(body=with_antenna("0 0 11")), "at most 10 m away"),
        (mjcf(option='<option gravity="0 0 -1.6"/>'), "gravity is 9.81 m/s² here"),
        (mjcf(option='<option wind="3 0 0"/>'), "wind the mission's; take both out"),
        (mjcf(option=declaring("antena_gain", 2)), "did you mean antenna_gain_dbi"),
        (mjcf(option=declaring("efficiency", 2)), "efficiency must be a number from 0.01 to 1"),
    ],
)
def test_a_file_that_is_no_robot_is_refused_in_a_line(own, text, said):
    name = own(text)
    with pytest.raises(ValueError, match=said) as raised:
        kinds_of(paper(robot=name, num_robots=2))
    assert str(raised.value).startswith(f"robot {name}: ")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("body", [BODY, PLANAR, with_antenna("0 0 -0.3")])
def test_a_robot_that_flies_or_rolls_is_taken(own, body):
    [kind] = kinds_of(paper(robot=own(mjcf(body=body)), num_robots=2))
    assert kind.is_free == (body != PLANAR)
