from functools import partial

import mujoco
import numpy as np
import pytest
from robot_files import BODY, LIFT, SENSORS, mjcf, with_antenna, written

from swarm_mj import paper
from swarm_mj.physics.pilots import Pilot, QuadrotorPilot, RoverPilot
from swarm_mj.physics.robots import (
    antennas_of,
    heading_of,
    kinds_of,
    make_pilots,
    pose_of,
    sensor_columns,
    sensor_limits,
)
from swarm_mj.physics.scene import compose
from swarm_mj.simulation.swarm import Swarm


@pytest.fixture
def own(tmp_path):
    """Writes a robot's file; returns its name."""
    return partial(written, tmp_path)


def steady(_sensed, _wanted, control):
    control[:] = 1.0


def test_a_robot_s_numbers_are_those_of_its_file():
    [quadrotor] = kinds_of(paper(robot="quadrotor", num_robots=2))
    assert quadrotor.is_free
    assert quadrotor.step_s == 0.005
    airframe = quadrotor.airframe(0.005)
    assert airframe.mass_kg == pytest.approx(0.5)
    assert airframe.actuators == ("front", "left", "back", "right")
    # 6.11e-8 n² N at 1200 and 7800 revolutions a minute.
    assert airframe.least[0] == pytest.approx(6.11e-8 * 1200**2, rel=1e-3)
    assert airframe.most[0] == pytest.approx(6.11e-8 * 7800**2, rel=1e-3)


def test_a_rover_s_motors_push_along_and_turn_it():
    """Its third actuator, the grip, is no motor: its force follows its speed."""
    [rover] = kinds_of(paper(robot="rover", num_robots=2))
    thrust = rover.airframe(0.005).thrust
    np.testing.assert_allclose(thrust[0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(thrust[1], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert not np.any(thrust[2])


def test_kinds_follow_each_other():
    mission = paper(robot="quadrotor:3,rover:2", num_robots=5)
    first, second = kinds_of(mission)
    assert (first.first, first.num_robots) == (0, 3)
    assert (second.first, second.num_robots) == (3, 2)
    pilots = make_pilots([first, second], 0.005)
    assert isinstance(pilots[0], QuadrotorPilot)
    assert isinstance(pilots[1], RoverPilot)
    model = compose(mission).compile()
    assert (model.nq, model.nu) == (3 * 7 + 2 * 3, 3 * 4 + 2 * 3)
    assert model.body("r4/body").id > model.body("r0/body").id


def test_only_the_robot_of_a_file_comes_into_the_scene(own):
    mission = paper(robot=own(mjcf()), num_robots=3, num_windows=2)
    [kind] = kinds_of(mission)
    spec = compose(mission)
    before = sum(geom.name == "floor" for geom in spec.geoms)
    assert before == 1
    assert sum(str(geom.type).endswith("PLANE") for geom in spec.geoms) == 1
    assert len(spec.actuators) == 3
    assert kind.step_s == 0.002
    assert isinstance(steady, Pilot)
    assert make_pilots([kind], 0.002, steady) == [steady]


def test_a_file_needs_a_pilot(own):
    kinds = kinds_of(paper(robot=own(mjcf()), num_robots=3))
    with pytest.raises(ValueError, match="needs a pilot, which makes its controls"):
        make_pilots(kinds, 0.002)


def test_an_own_pilot_steers_the_file_among_others(own):
    mission = paper(robot=f"rover:1,{own(mjcf())}:2", num_robots=3)
    rover, mine = make_pilots(kinds_of(mission), 0.002, steady)
    assert isinstance(rover, RoverPilot)
    assert mine is steady


def test_an_own_pilot_for_one_of_two_shipped_kinds_is_refused():
    kinds = kinds_of(paper(robot="quadrotor:2,rover:2", num_robots=4))
    with pytest.raises(ValueError, match="each quadrotor or rover here"):
        make_pilots(kinds, 0.005, steady)
    with pytest.raises(TypeError, match="a pilot is called with"):
        make_pilots(kinds[:1], 0.005, lambda _: None)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("quadroter", "did you mean quadrotor"),
        ("gone.xml", "robot gone.xml: there is no such file"),
    ],
)
def test_an_unknown_robot_is_refused(name, said):
    with pytest.raises(ValueError, match=said):
        kinds_of(paper(robot=name, num_robots=2))


def test_a_team_s_pose_has_each_base_where_it_is():
    kinds = kinds_of(paper(robot="quadrotor:1,rover:1", num_robots=2))
    position_m = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 0.125]])
    half = 0.25 * np.pi
    attitude = np.array([[1.0, 0.0, 0.0, 0.0], [np.cos(half), 0.0, 0.0, np.sin(half)]])
    pose = pose_of(kinds, position_m, attitude)
    np.testing.assert_allclose(pose[:7], [1, 2, 3, 1, 0, 0, 0])
    np.testing.assert_allclose(pose[7:], [4, 5, 0.5 * np.pi])
    assert heading_of(attitude[1]) == pytest.approx(0.5 * np.pi)


def test_the_inertia_is_that_of_the_whole_robot(own):
    """A mass of 0.1 kg at 0.5 m along x adds 0.025 kg m² about y and z, and none about x."""
    far = '<body pos="0.5 0 0"><geom size="0.001" mass="0.1"/></body></body>'
    inertia = {}
    for name, body in (("alone", BODY), ("with", BODY.replace("</body>", far))):
        [kind] = kinds_of(paper(robot=own(mjcf(body=body)), num_robots=2))
        inertia[name] = kind.airframe(0.002).inertia_kgm2
        reach_m = kind.reach_m
    np.testing.assert_allclose(inertia["with"] - inertia["alone"], [0, 0.025, 0.025], atol=1e-6)
    assert reach_m == pytest.approx(0.501)


def test_a_scene_s_keyframe_has_each_robot_where_it_begins():
    mission = paper("random-walk", robot="quadrotor:2,rover:2", num_robots=4, range_ratio=1.0)
    swarm = Swarm(mission, [1])
    model = compose(mission, start=swarm.states).compile()
    data = mujoco.MjData(model)
    for load in (lambda: None, lambda: mujoco.mj_resetDataKeyframe(model, data, 0)):
        load()
        mujoco.mj_forward(model, data)
        place_m = np.array([data.body(f"r{i}/body").xpos for i in range(4)])
        np.testing.assert_allclose(place_m, swarm.states.position_m[0], atol=1e-6)
    heading = data.body("r2/body").xmat.reshape(3, 3)[:2, 0]
    velocity_mps = swarm.states.velocity_mps[0, 2, :2]
    np.testing.assert_allclose(heading, velocity_mps / np.linalg.norm(velocity_mps), atol=1e-6)


def test_robots_collide_by_their_own_geoms_and_masks():
    mission = paper(robot="quadrotor", num_robots=2)
    spec = compose(mission)
    hulls = [geom for geom in spec.geoms if geom.name.endswith("/hull")]
    assert [(hull.contype, hull.conaffinity) for hull in hulls] == [(2, 1), (2, 1)]
    assert spec.geom("r0/core").contype == 0
    colliding = compose(paper(robot="quadrotor", num_robots=2, collide=True))
    assert colliding.geom("r0/hull").conaffinity == 3


def test_each_sensor_has_its_columns_and_its_cutoff(own):
    """A gyro has three numbers; the rangefinder without a name is in the fourth column."""
    mission = paper(robot=f"rover:1,{own(mjcf(actuator=LIFT + SENSORS))}:2", num_robots=3)
    columns = {"turns": slice(0, 3), "bumper": slice(4, 5)}
    assert sensor_columns(mission) == [{}, columns]
    kinds = kinds_of(mission)
    assert kinds[1].airframe(0.002).sensors == columns
    assert sensor_limits(kinds).tolist() == [np.inf, np.inf, np.inf, 7.0, 3.0]
    assert sensor_limits(kinds[:1]).size == 0
    assert sensor_columns(paper(num_robots=3)) == []


def test_mujoco_cuts_no_places_off(own):
    """The segment between two geoms is two places, wherever its length is cut off."""
    body = BODY.replace("<geom ", '<geom name="g" ').replace(
        "</body>", '<body pos="0 0 1"><geom name="h" size="0.1" mass="0.1"/></body></body>'
    )
    segment = '<sensor><fromto geom1="g" geom2="h" cutoff="3"/></sensor>'
    kinds = kinds_of(paper(robot=own(mjcf(body=body, actuator=LIFT + segment)), num_robots=2))
    assert sensor_limits(kinds).tolist() == [np.inf] * 6


def test_limits_are_those_of_all_kinds(own, tmp_path):
    """The first column is a force up to 5 N of one kind, and a range up to 2 m of another."""
    near = tmp_path / "near.xml"
    near.write_text(mjcf(actuator=f'{LIFT}<sensor><rangefinder site="s" cutoff="2"/></sensor>'))
    bumper = '<sensor><touch site="s" cutoff="5"/><touch site="s" cutoff="1"/></sensor>'
    mission = paper(robot=f"{own(mjcf(actuator=LIFT + bumper))}:1,{near}:1", num_robots=2)
    assert sensor_limits(kinds_of(mission)).tolist() == [5.0, 1.0]


def test_antennas_are_as_their_models_declare_robot_by_robot(own):
    """The quadrotor has none; the file's is 0.3 m up, gains 10 dBi, and sends with a tenth."""
    option = '<option timestep="0.002"/><custom><numeric name="antenna_gain_dbi" data="10"/>'
    option += '<numeric name="power_class_db" data="-10"/></custom>'
    name = own(mjcf(body=with_antenna("0 0 0.3"), option=option))
    antennas = antennas_of(paper(robot=f"quadrotor:2,{name}:1", num_robots=3))
    np.testing.assert_allclose(antennas.height_m, [0.0, 0.0, 0.3])
    np.testing.assert_allclose(antennas.gain, [1.0, 1.0, 10.0])
    np.testing.assert_allclose(antennas.power, [1.0, 1.0, 0.1])
    assert not antennas.are_alike


def test_the_rovers_antenna_is_on_its_deck():
    """Its data sheet's height, over the floor; all alike, so nothing changes in free space."""
    mission = paper(robot="rover", num_robots=2)
    [kind] = kinds_of(mission)
    assert kind.base_m + kind.antenna_m == pytest.approx(0.250)
    assert antennas_of(mission).are_alike


def test_points_and_quadrotors_declare_no_antennas():
    assert antennas_of(paper(num_robots=2)) is None
    assert antennas_of(paper(robot="quadrotor", num_robots=2)) is None
