"""Worlds of robots with bodies: set points, wind, crashes, and the same mission in any batch."""

import numpy as np
import pytest
from mujoco import MjData, mj_forward, mj_step, mjtEnableBit
from scanners import SCANNERS

from swarm_mj import make_policy, paper
from swarm_mj.physics.bodies import BodyWorlds
from swarm_mj.physics.robots import kinds_of
from swarm_mj.physics.scene import compose
from swarm_mj.policies.registry import POLICIES
from swarm_mj.protocol.packets import packet_of
from swarm_mj.simulation.swarm import Swarm

BOX = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <body name="base">
      <freejoint/><geom type="box" size="0.2 0.2 0.2" mass="1"/><site name="s"/>
    </body>
  </worldbody>
  <actuator><motor name="lift" site="s" gear="0 0 1 0 0 0"/></actuator>
</mujoco>
"""


class Resting:
    """No lift at all: what it steers falls."""

    def __call__(self, _sensed, _wanted, control):
        control[:] = 0.0


class Hovering:
    """As much lift as weight, upwards as long as nothing turns the box."""

    def __init__(self, airframe):
        self.lift_n = 9.81 * airframe.mass_kg

    def __call__(self, _sensed, _wanted, control):
        control[:] = self.lift_n


@pytest.fixture
def box(tmp_path):
    path = tmp_path / "box.xml"
    path.write_text(BOX)
    return str(path)


def flown(mission, seeds, num_windows, policy="tdma", **options):
    """The swarm after some windows."""
    swarm = Swarm(mission, seeds, **options)
    swarm.start(make_policy(policy, mission))
    for _ in range(num_windows):
        swarm.step()
    return swarm


def test_a_body_without_lift_falls_freely(box):
    """g t² / 2, less what drag and Euler's steps change."""
    mission = paper("stationary", robot=box, num_robots=3, height_m=100.0)
    swarm = flown(mission, [1], 3, pilot=Resting())
    fallen_m = 100.0 - swarm.states.position_m[0, :, 2]
    np.testing.assert_allclose(fallen_m, 0.5 * 9.81 * 0.3**2, rtol=0.05)
    np.testing.assert_allclose(swarm.states.velocity_mps[0, :, 2], -9.81 * 0.3, rtol=0.05)


def test_its_terminal_speed_is_that_of_its_drag(box):
    """MuJoCo's drag of a box, rho v² A / 2 downwards, is the weight at sqrt(2 m g / rho A)."""
    mission = paper("stationary", robot=box, num_robots=2, height_m=1000.0, num_windows=300)
    swarm = flown(mission, [1], 130, pilot=Resting())
    terminal_mps = np.sqrt(2.0 * 1.0 * 9.81 / (1.204 * 0.4 * 0.4))
    np.testing.assert_allclose(swarm.states.velocity_mps[0, :, 2], -terminal_mps, rtol=0.15)


BALL = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <body name="base">
      <freejoint/><site name="s"/>
      <geom type="sphere" size="0.1" mass="10" priority="1" condim="1"
        solref="-10000 -{damping}" solimp="0.9999 0.9999 0.001 0.5 2"/>
    </body>
  </worldbody>
  <actuator><motor name="lift" site="s" gear="0 0 1 0 0 0"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("damping_ratio", [0.0, 0.1, 0.2, 0.4])
def test_a_file_s_contact_parameters_say_how_high_it_bounces(tmp_path, damping_ratio):
    """A spring and a damper that push only: Schwager and Poschel, Granular Matter 9 (2007)."""
    stiffness = 10_000.0  # of `BALL`, over the mass [1/s²]
    decay = damping_ratio * np.sqrt(stiffness)
    turn = np.sqrt(stiffness - decay**2)
    contact = np.pi - np.arctan2(2.0 * decay * turn, turn**2 - decay**2)
    restitution = np.exp(-decay / turn * contact)
    path = tmp_path / "ball.xml"
    path.write_text(BALL.format(damping=2.0 * decay))
    mission = paper("stationary", robot=str(path), num_robots=2, height_m=2.0)
    swarm = flown(mission, [1], 8, pilot=Resting())  # 0.62 s to the floor, then upwards
    velocity_mps = swarm.states.velocity_mps[0, :, 2]
    risen_m = swarm.states.position_m[0, :, 2] - 0.1
    assert np.all(velocity_mps > 0.0)
    kept = (velocity_mps**2 / 2.0 + 9.81 * risen_m) / (9.81 * (2.0 - 0.1))
    np.testing.assert_allclose(kept, restitution**2, atol=0.015)


def test_a_quadrotor_that_fell_lies_on_the_floor_which_carries_its_weight():
    """Its hull is 0.1 m high; MuJoCo's usual contacts, which `quadrotor.xml` has, do not bounce.

    Its four rotors still lift the least that they can.
    """
    mission = paper("stationary", robot="quadrotor", num_robots=2, height_m=2.0)
    worlds = BodyWorlds(mission, 1, pilot=Resting())
    worlds.start([np.random.default_rng(0)], [])
    position_m = np.array([[[0.0, 0.0, 2.0], [50.0, 0.0, 2.0]]])
    worlds.place(position_m, np.zeros_like(position_m))
    for _ in range(40):
        states = worlds.step(np.zeros_like(position_m))
    np.testing.assert_allclose(states.position_m[0, :, 2], 0.05, atol=0.003)
    np.testing.assert_allclose(states.velocity_mps, 0.0, atol=1e-3)
    np.testing.assert_allclose(
        worlds._flown[0].contact_n[0, :, 2], 0.5 * 9.81 - 4 * 0.088, rtol=0.001
    )


def energy_drift_j(step_s, turn_rate_rps):
    """Energy that one of two quadrotors in a vacuum wins as it falls and turns for 0.5 s."""
    model = compose(paper("stationary", robot="quadrotor", num_robots=2)).compile()
    model.opt.density = 0.0
    model.opt.viscosity = 0.0
    model.opt.timestep = step_s
    model.opt.enableflags |= int(mjtEnableBit.mjENBL_ENERGY)
    model.actuator_ctrllimited[:] = False  # no rotor turns, not even at its least
    data = MjData(model)
    for i in range(2):
        data.qpos[7 * i : 7 * i + 4] = (50.0 * i, 0.0, 20.0, 1.0)
        data.qvel[6 * i + 3 : 6 * i + 6] = turn_rate_rps
    mj_forward(model, data)
    before_j = data.energy.sum()
    for _ in range(round(0.5 / step_s)):
        mj_step(model, data)
    mj_forward(model, data)
    return (data.energy.sum() - before_j) / 2.0


@pytest.mark.parametrize("step_s", [0.01, 0.005, 0.0025])
def test_energy_drifts_in_proportion_to_euler_s_step(step_s):
    """In free fall by m g² h t / 2 exactly; what turns, too, drifts half as much at half a step."""
    fall_j = energy_drift_j(step_s, (0.0, 0.0, 0.0))
    assert fall_j == pytest.approx(-0.5 * 9.81**2 * step_s * 0.5 / 2.0, rel=1e-9)
    turning_rps = (3.0, 4.0, 5.0)
    whole_j = energy_drift_j(step_s, turning_rps) - fall_j
    half_step_j = energy_drift_j(step_s / 2.0, turning_rps) - fall_j / 2.0
    assert whole_j == pytest.approx(2.0 * half_step_j, rel=0.03)
    kinetic_j = 0.5 * np.dot([2.32e-3, 2.32e-3, 4e-3], np.square(turning_rps))
    assert abs(whole_j) < 0.03 * kinetic_j


def test_what_lifts_its_weight_hovers(box):
    mission = paper("stationary", robot=box, num_robots=3, height_m=2.0)
    hovering = flown(mission, [1], 20, pilot=Hovering(_airframe_of(mission)))
    np.testing.assert_allclose(hovering.states.position_m[0, :, 2], 2.0, atol=1e-9)
    assert hovering.states.is_active is None
    assert not hovering.states.has_crashed.any()


def _airframe_of(mission):
    [kind] = kinds_of(mission)
    return kind.airframe(0.005)


def test_two_robots_stay_on_whoever_crashes(box):
    """An age needs a pair of robots, so the last that crash together count as before."""
    mission = paper("stationary", robot=box, num_robots=4, height_m=1.0)
    swarm = flown(mission, [1], 20, pilot=Resting())
    assert np.all(swarm.states.position_m[0, :, 2] < 0.5)
    assert swarm.states.has_crashed.all()
    assert swarm.states.is_active.tolist() == [[True, True, False, False]]


def test_what_failed_never_counts_again():
    """Of three that work one crashes, then another: its radio goes on, and none wakes up again."""
    worlds = BodyWorlds(paper("stationary", robot="quadrotor", num_robots=5), 1)
    worlds.deactivate(np.array([[False, True, True, True, False]]))
    worlds._has_crashed[0, 1] = True
    worlds._count_active()
    assert worlds.states.is_active.tolist() == [[False, False, True, True, False]]
    worlds._has_crashed[0, 2] = True
    worlds._count_active()
    assert worlds.states.is_active.tolist() == [[False, False, True, True, False]]


def test_robots_that_crashed_fly_again_in_the_next_mission(box):
    mission = paper("stationary", robot=box, num_robots=3, height_m=1.0)
    swarm = flown(mission, [1], 20, pilot=Resting())
    assert swarm.states.is_active is not None
    swarm.restart([2])
    assert swarm.states.is_active is None
    assert not swarm.states.has_crashed.any()


def test_a_pilot_is_named_too(box, tmp_path, monkeypatch):
    (tmp_path / "hovering_pilot.py").write_text(
        "class Pilot:\n"
        "    def __init__(self, airframe):\n"
        "        self.lift_n = 9.81 * airframe.mass_kg\n"
        "    def __call__(self, sensed, wanted, control):\n"
        "        control[:] = self.lift_n\n"
    )
    monkeypatch.chdir(tmp_path)
    mission = paper("stationary", robot=box, num_robots=2, height_m=2.0)
    swarm = flown(mission, [1], 3, pilot="hovering_pilot:Pilot")
    np.testing.assert_allclose(swarm.states.position_m[0, :, 2], 2.0, atol=1e-9)


def test_points_have_no_pilot():
    with pytest.raises(ValueError, match="a point needs none; choose a robot"):
        Swarm(paper("flocking", num_robots=2), [1], pilot=Resting())


def test_a_pilot_whose_robots_fly_apart_is_named(box):
    class Violent:
        def __call__(self, _sensed, _wanted, control):
            control[:] = 1e9

    mission = paper("stationary", robot=box, num_robots=2)
    with pytest.raises(ValueError, match="not stable under its pilot"):
        flown(mission, [1], 2, pilot=Violent())


@pytest.mark.parametrize("array", ["qpos", "qvel"])
@pytest.mark.parametrize("number", [2e6, -1e9])
def test_a_robot_that_is_lost_is_named_before_mujoco_steps_on(box, array, number):
    """MuJoCo crashed the process some steps after it had lost a robot in a storm."""
    worlds, start_m = pair_at_rest(box, pilot=Resting())
    getattr(worlds._flown[0], array)[0, 1, 1] = number
    with pytest.raises(ValueError, match="robot 1 of mission 0 is nowhere: its model is not"):
        worlds.step(np.zeros_like(start_m))


def test_what_has_crashed_tumbles_at_most_so_fast_that_euler_s_steps_bear_it():
    """A turn of 100 rad/s is half a radian a step; without the limit it grows without end."""
    worlds, start_m = pair_at_rest("quadrotor", wind_mps=20.0)
    worlds._has_crashed[0, 0] = True
    worlds._flown[0].qvel[0, :, 3:6] = [[-300.0, 200.0, 80.0], [1.0, 1.0, 1.0]]
    worlds.step(np.zeros_like(start_m))
    rates_rps = np.abs(worlds._flown[0].qvel[0, :, 3:6])
    assert 50.0 < rates_rps[0].max() <= 100.0
    assert rates_rps[1].max() < 2.0


@pytest.mark.slow
def test_a_storm_ends_no_mission():
    """Winds of 30 m/s and gusts tear robots down, and the mission goes on to its end."""
    mission = paper("flocking", robot="quadrotor", wind_mps=30.0, gust_mps=12.0)
    swarm = flown(mission, [1, 2], 500, policy="round-robin")
    assert swarm.states.has_crashed.any()
    assert np.all(np.isfinite(swarm.states.position_m))


def test_a_pilot_that_writes_no_numbers_is_named(box):
    class Lost:
        def __call__(self, _sensed, _wanted, control):
            control[:] = np.nan

    mission = paper("stationary", robot=box, num_robots=2)
    said = "must write finite controls, not nan, which robot 0 has for lift"
    with pytest.raises(ValueError, match=said):
        flown(mission, [1], 2, pilot=Lost())


def test_a_pilot_that_returns_its_controls_is_refused(box):
    class Returning:
        def __call__(self, _sensed, _wanted, control):
            return np.ones_like(control)

    mission = paper("stationary", robot=box, num_robots=2)
    with pytest.raises(TypeError, match="write its controls into `control`, and return nothing"):
        flown(mission, [1], 2, pilot=Returning())


def test_a_pilot_is_a_class_too_and_begins_anew_with_every_mission(box):
    started = []

    class Counting(Hovering):
        def start(self, num_robots, rngs):
            started.append((num_robots, len(rngs)))

        def __call__(self, sensed, wanted, control):
            assert not sensed.position_m.flags.writeable
            assert not wanted.velocity_mps.flags.writeable
            super().__call__(sensed, wanted, control)

    swarm = flown(paper("stationary", robot=box, num_robots=3), [1, 2], 1, pilot=Counting)
    swarm.restart([3, 4])
    assert started == [(3, 2), (3, 2)]


def test_a_pilot_draws_from_a_stream_of_its_own(box):
    """However many numbers it draws, the gusts are as before."""

    class Drawing(Hovering):
        def start(self, _num_robots, rngs):
            for rng in rngs:
                rng.normal(size=7)

    mission = paper("stationary", robot=box, num_robots=2, wind_mps=1.0, gust_mps=2.0)
    winds_mps = []
    for pilot in (Hovering, Drawing):
        swarm = flown(mission, [1], 3, pilot=pilot)
        winds_mps.append(swarm.states.wind_mps)
    assert np.any(winds_mps[0])
    np.testing.assert_array_equal(winds_mps[0], winds_mps[1])


def test_a_scene_must_leave_the_robots():
    def heavier(spec, _mission):
        spec.body("r0/body").add_geom(size=[0.1, 0.0, 0.0], mass=3.0)

    def harmless(spec, _mission):
        spec.geom("r1/hull").contype = 0
        spec.geom("r1/hull").conaffinity = 0

    for scene in (heavier, harmless):
        with pytest.raises(ValueError, match="a scene must leave the robots"):
            Swarm(paper("flocking", robot="quadrotor", num_robots=3), [1], scene=scene)


def test_a_set_point_sinks_no_further_than_half_a_metre():
    """A controller that asks for 1 m/s downwards for ever lands nobody."""

    def sink(_buffers, states):
        wanted = np.zeros_like(states.velocity_mps)
        wanted[..., 2] = -1.0 - states.velocity_mps[..., 2]
        return wanted

    mission = paper("flocking", robot="quadrotor", num_robots=3, height_m=3.0)
    swarm = flown(mission, [1], 150, controller=sink)
    assert swarm.states.is_active is None
    np.testing.assert_allclose(swarm.states.position_m[..., 2], 0.5, atol=0.1)


def test_quadrotors_that_touch_crash_only_if_they_collide():
    for collide in (False, True):
        mission = paper("stationary", robot="quadrotor", num_robots=4, collide=collide)
        worlds = BodyWorlds(mission, 1)
        worlds.start([np.random.default_rng(0)], [])
        position_m = np.array([[[0.0, 0, 20], [0.3, 0, 20], [50, 0, 20], [-50, 0, 20]]])
        worlds.place(position_m, np.zeros_like(position_m))
        states = worlds.step(np.zeros_like(position_m))
        assert states.has_crashed.tolist() == [[collide, collide, False, False]]


def test_packets_of_bodies_hold_a_third_axis():
    """24 bits more for each robot: 16 of its place, 8 of its velocity."""
    flat = packet_of(paper(num_robots=40))
    tall = packet_of(paper(num_robots=40, robot="quadrotor"))
    assert tall.num_bytes - flat.num_bytes == 40 * 3


@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
def test_no_quadrotor_falls_in_calm(task):
    mission = paper(task, robot="quadrotor", num_robots=20, range_ratio=0.5)
    swarm = flown(mission, [1, 2], 100)
    assert swarm.states.is_active is None
    np.testing.assert_allclose(swarm.states.position_m[..., 2], 20.0, atol=0.5)


def test_a_flock_of_quadrotors_agrees():
    mission = paper("flocking", robot="quadrotor", num_robots=20)
    swarm = Swarm(mission, [1])
    first = np.var(swarm.states.velocity_mps[0], axis=0).sum()
    swarm.start(make_policy("tdma", mission))
    for _ in range(150):
        costs = swarm.step()
    assert costs.velocity_variance_m2ps2[0] < 0.01 * first


def test_walking_robots_turn_at_the_edge():
    """Within the way that they brake on."""
    mission = paper("random-walk", robot="quadrotor:5,rover:5", num_robots=10, velocity_ratio=0.5)
    swarm = flown(mission, [1], 200)
    farthest_m = np.max(np.abs(swarm.states.position_m[..., :2]))
    assert farthest_m < mission.half_side_m + 10.0


def pair_at_rest(robot, pilot=None, **fields):
    """A world of two robots, which start at rest 100 m apart."""
    mission = paper("random-walk", robot=robot, num_robots=2, **fields)
    worlds = BodyWorlds(mission, 1, pilot=pilot)
    worlds.start([np.random.default_rng(0)], [])
    position_m = np.zeros((1, 2, 3))
    position_m[0, :, 0] = (-50.0, 50.0)
    position_m[..., 2] = worlds.draw_heights_m(np.random.default_rng(0))
    worlds.place(position_m, np.zeros_like(position_m))
    return worlds, position_m


def stepped(worlds, num_windows):
    """The states after some windows in which nothing accelerates."""
    still = np.zeros_like(worlds.states.position_m)
    for _ in range(num_windows):
        states = worlds.step(still)
    return states


def test_a_quadrotor_at_rest_in_a_wind_stays_near_its_place():
    """Downwind by its drift in m/s over 0.6 per second, which is what it flies back with."""
    worlds, start_m = pair_at_rest("quadrotor", wind_mps=8.0)
    settled_m = stepped(worlds, 150).position_m
    states = stepped(worlds, 10)
    np.testing.assert_allclose(states.position_m, settled_m, atol=0.01)
    off_m = states.position_m - start_m
    side_m, flat_m = 0.219, 0.088  # of the box of its inertia
    drag_mps2 = 0.5 * 1.204 * side_m * flat_m * 8.0**2 / 0.5
    np.testing.assert_allclose(off_m[..., 0], drag_mps2 / 2.5 / 0.6, rtol=0.35)
    np.testing.assert_allclose(off_m[..., 1], 0.0, atol=0.01)


def test_a_strong_wind_does_not_blow_a_rover_off():
    """It drifted by 10 m in half a minute."""
    worlds, start_m = pair_at_rest("rover", wind_mps=20.0)
    states = stepped(worlds, 300)
    np.testing.assert_allclose(states.position_m, start_m, atol=0.7)


@pytest.mark.parametrize("robot", ["quadrotor", "rover"])
def test_a_robot_returns_to_where_its_set_point_came_to_rest(robot):
    worlds, start_m = pair_at_rest(robot)
    acceleration = np.zeros_like(start_m)
    acceleration[0, :, 0] = 10.0
    worlds.step(acceleration)  # 1 m/s
    before_m = stepped(worlds, 29).position_m.copy()
    worlds.step(-acceleration)
    overshot_m = stepped(worlds, 4).position_m.copy()
    states = stepped(worlds, 100)
    np.testing.assert_allclose(states.position_m[..., 0], before_m[..., 0], atol=0.02)
    assert np.all(overshot_m[..., 0] > states.position_m[..., 0] + 0.02)
    np.testing.assert_allclose(states.position_m[..., 1:], start_m[..., 1:], atol=0.01)


def test_a_set_point_that_comes_to_rest_but_for_rounding_rests():
    """Three windows of 1 m/s² and three back leave 2.8e-17 m/s; in 8 m/s it drifted by 30 m."""
    worlds, start_m = pair_at_rest("quadrotor", wind_mps=8.0)
    for u in (1.0, 1.0, 1.0, -1.0, -1.0, -1.0):
        acceleration = np.zeros_like(start_m)
        acceleration[..., 0] = u
        worlds.step(acceleration)
    assert np.all(worlds._course_mps[..., 0] != 0.0)
    first_m = worlds.states.position_m.copy()
    states = stepped(worlds, 300)
    assert np.all(np.abs(states.position_m - first_m) < 2.0)


def test_pilots_of_robots_that_move_get_the_set_points_as_they_are():
    """Each is the last one plus u dt, as of points; nothing pulls them back."""
    worlds, start_m = pair_at_rest("quadrotor", wind_mps=10.0)
    rng = np.random.default_rng(5)
    due_mps = np.zeros_like(start_m)
    for _ in range(20):
        acceleration = rng.uniform(-2.0, 2.0, start_m.shape)
        due_mps += acceleration * 0.1
        worlds.step(acceleration)
        np.testing.assert_allclose(worlds._flown[0].wanted.velocity_mps, due_mps, atol=1e-12)


def test_a_set_point_never_flies_back_faster_than_robots_may():
    """50 m off its place, at V_max = 3 m/s per axis."""
    worlds, _ = pair_at_rest("quadrotor")
    worlds._place_m += 50.0
    stepped(worlds, 1)
    np.testing.assert_allclose(worlds._flown[0].wanted.velocity_mps[..., :2], 3.0)


def test_a_mission_is_the_same_in_any_batch_and_on_any_number_of_threads():
    mission = paper("random-walk", robot="quadrotor", num_robots=8, range_ratio=0.6, gust_mps=2.0)
    alone = flown(mission, [7], 20)
    batch = flown(mission, [3, 7, 9], 20, num_threads=2)
    np.testing.assert_array_equal(alone.states.position_m[0], batch.states.position_m[1])
    np.testing.assert_array_equal(alone.states.attitude[0], batch.states.attitude[1])
    assert not np.array_equal(batch.states.position_m[0], batch.states.position_m[2])


def test_a_mission_begins_anew_as_it_began():
    mission = paper("flocking", robot="quadrotor:3,rover:3", num_robots=6, gust_mps=1.0)
    swarm = Swarm(mission, [4])
    policy = make_policy("tdma", mission)
    seen = []
    for _ in range(2):
        swarm.restart([4])
        swarm.start(policy)
        for _ in range(10):
            swarm.step()
        seen.append(swarm.states.position_m.copy())
    np.testing.assert_array_equal(*seen)


def test_robots_differ_by_their_spread_and_hover_all_the_same():
    """A heavier one hangs lower, by what its pilot does not know of its weight."""
    mission = paper("stationary", robot="quadrotor:10,rover:10", num_robots=20, robot_spread=0.05)
    swarm = flown(mission, [1, 2], 50)
    height_m = swarm.states.position_m[:, :10, 2]
    assert swarm.states.is_active is None
    assert 0.01 < np.std(height_m) < 0.5
    assert not np.array_equal(height_m[0], height_m[1])
    alone = flown(mission, [2], 50)
    np.testing.assert_array_equal(alone.states.position_m[0], swarm.states.position_m[1])


def test_heights_are_spread_over_their_range():
    mission = paper("stationary", robot="quadrotor", height_m=10.0, height_range_m=30.0)
    height_m = Swarm(mission, [1]).states.position_m[0, :, 2]
    assert np.all((height_m >= 10.0) & (height_m <= 40.0))
    assert np.ptp(height_m) > 15.0


def test_quadrotors_among_trees_crash_and_are_off():
    """At 5 m they meet trees of 10 m, which nobody avoids; above the trees they meet none."""
    fields = {"arena": "forest", "num_robots": 20, "velocity_ratio": 0.5}
    low = flown(paper("random-walk", robot="quadrotor", height_m=5.0, **fields), [1], 200)
    assert low.states.is_active is not None
    assert 2 <= low.states.is_active.sum() < 20
    high = flown(paper("random-walk", robot="quadrotor", height_m=20.0, **fields), [1], 200)
    assert high.states.is_active is None


def test_robots_that_fail_keep_flying_and_those_that_crash_stay_off():
    mission = paper(
        "random-walk", robot="quadrotor", num_robots=20, num_windows=20, failure_fraction=0.25
    )
    swarm = flown(mission, [1], 20)
    assert swarm.states.is_active.sum() == 15
    np.testing.assert_allclose(swarm.states.position_m[..., 2], 20.0, atol=0.5)


@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_flies_robots_with_heights(policy):
    mission = paper(
        "random-walk", robot="quadrotor", num_robots=6, range_ratio=0.5, height_range_m=50.0
    )
    swarm = flown(mission, [1], 8, policy=policy)
    assert swarm.buffers.position_m.shape == (1, 6, 6, 3)
    heard = swarm.buffers.is_known[0] & ~np.eye(6, dtype=bool)
    believed_m = swarm.buffers.position_m[0, ..., 2]
    assert np.all(believed_m[heard] >= 15.0)


def test_packets_take_the_distance_in_space():
    """At 240 m on the map a packet decodes within 250 m, but not to a robot 100 m higher."""
    mission = paper("stationary", robot="quadrotor", num_robots=2)
    radio = Swarm(mission, [1]).channel
    sends = np.array([[-1, 1]])
    for height_m, heard in ((20.0, 0), (120.0, 1)):
        position_m = np.array([[[0.0, 0.0, 20.0], [240.0, 0.0, height_m]]])
        assert radio(position_m, sends)[0, 1] == heard


FEELER = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <body name="base">
      <freejoint/><geom type="box" size="0.2 0.2 0.2" mass="1"/><site name="s"/>
      <site name="east" zaxis="1 0 0"/><site name="west" zaxis="-1 0 0"/>
      <site name="down" zaxis="0 0 -1"/>
    </body>
  </worldbody>
  <actuator><motor name="lift" site="s" gear="0 0 1 0 0 0"/></actuator>
  <sensor>
    <rangefinder name="up" site="s"/>
    <rangefinder name="down" site="down"/>
    <rangefinder name="east" site="east"/>
    <rangefinder name="west" site="west" cutoff="20"/>
    <rangefinder name="near" site="s" cutoff="0.5"/>
    <gyro name="gyro" site="s"/>
    <accelerometer name="felt" site="s"/>
  </sensor>
</mujoco>
"""
UP, DOWN, EAST, WEST, NEAR = range(5)


@pytest.fixture
def feeler(tmp_path):
    path = tmp_path / "feeler.xml"
    path.write_text(FEELER)
    return str(path)


def placed(mission, position_m, pilot, **options):
    """Worlds that begin at rest, at these places of the first mission and of all others."""
    worlds = BodyWorlds(mission, 2, pilot=pilot, **options)
    worlds.start([np.random.default_rng(b) for b in range(2)], [])
    position_m = np.broadcast_to(position_m, (2, mission.num_robots, 3)).copy()
    worlds.place(position_m, np.zeros_like(position_m))
    return worlds


@pytest.mark.parametrize(
    ("arena", "place_m", "east_m", "west_m"),
    [
        # Blocks of 110 m stand at every 200 m, one of them in the middle, up to 10 m.
        ("blocks", (60.0, 10.0, 4.0), 145.0 - 60.0, 60.0 - 55.0),
        ("blocks", (80.0, 10.0, 4.0), 145.0 - 80.0, 20.0),  # at 25 m, over its cutoff
        ("blocks", (80.0, 10.0, 11.0), None, -1.0),  # over the roofs, where it sees nothing
        # The first tree, of a radius of 6 m, is at x = 0, y = (1/3 - 1/2) 1 km.
        ("forest", (10.0, -1000.0 / 6.0, 4.0), None, 4.0),
    ],
)
def test_ranges_are_those_to_walls_trees_and_the_floor(feeler, arena, place_m, east_m, west_m):
    mission = paper("stationary", robot=feeler, num_robots=40, arena=arena)
    others_m = np.column_stack(
        [np.linspace(-400.0, 400.0, 40), np.full(40, 499.0), np.full(40, 90)]
    )
    others_m[0] = place_m
    worlds = placed(mission, others_m, Resting())
    sensed = worlds.states.sensors[:, 0]
    np.testing.assert_allclose(sensed[:, DOWN], place_m[2], rtol=1e-12)
    np.testing.assert_allclose(sensed[:, WEST], west_m, rtol=1e-9)
    np.testing.assert_allclose(sensed[:, UP], -1.0)  # MuJoCo's word for nothing, which a
    np.testing.assert_allclose(sensed[:, NEAR], -0.5)  # cutoff of less than 1 m cuts off, too
    if east_m is not None:
        np.testing.assert_allclose(sensed[:, EAST], east_m, rtol=1e-9)


def test_robots_see_each_other_but_not_what_is_drawn_transparent(feeler):
    """The quadrotor's arm ends 0.175 m from its middle; its hull, at 0.27 m, is invisible."""
    mission = paper("stationary", robot=f"{feeler}:1,quadrotor:1", num_robots=2)
    worlds = placed(mission, [[0.0, 0.0, 20.0], [5.0, 0.0, 20.0]], Resting())
    np.testing.assert_allclose(worlds.states.sensors[:, 0, EAST], 5.0 - 0.175, rtol=1e-12)


def test_what_hovers_feels_its_weight_and_what_falls_nothing(feeler):
    mission = paper("stationary", robot=feeler, num_robots=2, height_m=50.0)
    hovering = flown(mission, [1], 2, pilot=Hovering(_airframe_of(mission)))
    falling = flown(mission, [1], 1, pilot=Resting())
    np.testing.assert_allclose(hovering.states.sensors[0, :, 5:8], 0.0, atol=1e-12)
    np.testing.assert_allclose(hovering.states.sensors[0, :, 8:], [[0, 0, 9.81]] * 2, atol=1e-9)
    # But for drag, rho v² A / 2, a step before its end.
    fallen_mps = falling.states.velocity_mps[0, :, 2] + 9.81 * 0.005
    drag_mps2 = 0.5 * 1.204 * 0.4 * 0.4 * fallen_mps**2
    np.testing.assert_allclose(falling.states.sensors[0, :, 10], drag_mps2, rtol=0.02)
    np.testing.assert_allclose(falling.states.sensors[0, :, 8:10], 0.0, atol=1e-12)


def test_after_a_window_sensors_are_of_a_step_ago(feeler):
    """Euler's last step moved the box by v h, h = 5 ms."""
    mission = paper("stationary", robot=feeler, num_robots=2, height_m=50.0)
    swarm = flown(mission, [1], 3, pilot=Resting())
    height_m = swarm.states.position_m[0, :, 2]
    before_m = height_m - 0.005 * swarm.states.velocity_mps[0, :, 2]
    np.testing.assert_allclose(swarm.states.sensors[0, :, DOWN], before_m, rtol=1e-12)
    kept = swarm.states.sensors
    copied = kept.copy()
    swarm.step()
    np.testing.assert_array_equal(kept, copied)
    assert not np.array_equal(swarm.states.sensors, kept)


def test_a_pilot_begins_with_what_sensors_measure_there(feeler):
    seen = []

    class Looking:
        def __call__(self, sensed, _wanted, control):
            assert not sensed.sensors.flags.writeable
            seen.append(sensed.sensors[0, :, DOWN].copy())
            control[:] = 0.0

    mission = paper("stationary", robot=feeler, num_robots=2)
    worlds = placed(mission, [[0.0, 0.0, 20.0], [9.0, 0.0, 30.0]], Looking())
    higher_m = np.broadcast_to([[0.0, 0.0, 40.0], [9.0, 0.0, 50.0]], (2, 2, 3)).copy()
    worlds.place(higher_m, np.zeros_like(higher_m))
    np.testing.assert_allclose(seen, [[20.0, 30.0], [40.0, 50.0]])


def test_robots_with_fewer_sensors_have_zeros_behind_their_own(feeler, tmp_path):
    """Of a rover, which has none, of one whose only sensor is a height, and of one with 11."""
    path = tmp_path / "low.xml"
    path.write_text(
        BOX.replace("</mujoco>", '<sensor><framepos objtype="site" objname="s"/></sensor></mujoco>')
    )
    mission = paper("stationary", robot=f"rover:1,{path}:2,{feeler}:1", num_robots=4)
    places_m = np.array([[-30.0, 0.0, 0.125], [0, 5, 9], [8, 0, 12], [99, 0, 40]])
    sensed = placed(mission, places_m, Resting()).states.sensors
    assert sensed.shape == (2, 4, 11)
    for b in range(2):
        assert not sensed[b, 0].any()
        np.testing.assert_allclose(sensed[b, 1:3, :3], places_m[1:3])
        assert not sensed[b, 1:3, 3:].any()
        assert sensed[b, 3, DOWN] == pytest.approx(40.0)


def test_robots_without_sensors_have_no_numbers_of_them(box):
    assert Swarm(paper("flocking", num_robots=2), [1]).states.sensors is None
    assert Swarm(paper("flocking", num_robots=2, robot="quadrotor"), [1]).states.sensors is None
    assert Swarm(paper(num_robots=2, robot=box), [1], pilot=Resting()).states.sensors is None


def test_sensors_are_the_same_in_any_batch():
    mission = paper(
        "random-walk", num_robots=8, range_ratio=0.6, arena="forest", robot=SCANNERS["robot"]
    )
    alone = flown(mission, [7], 20, pilot=SCANNERS["pilot"])
    batch = flown(mission, [3, 7, 9], 20, num_threads=2, pilot=SCANNERS["pilot"])
    np.testing.assert_array_equal(alone.states.sensors[0], batch.states.sensors[1])
    assert not np.array_equal(batch.states.sensors[0], batch.states.sensors[1])


def test_a_controller_sees_sensors_and_cannot_change_them(feeler):
    seen = []

    def climb(_buffers, states):
        seen.append(states.sensors[0, :, DOWN].copy())
        states.sensors[:] = 77.0
        return np.zeros_like(states.velocity_mps)

    mission = paper("stationary", robot=feeler, num_robots=2, height_m=30.0)
    swarm = flown(mission, [1], 2, controller=climb, pilot=Hovering(_airframe_of(mission)))
    np.testing.assert_allclose(seen, 30.0)
    np.testing.assert_allclose(swarm.states.sensors[0, :, DOWN], 30.0)
