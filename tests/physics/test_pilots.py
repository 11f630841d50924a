"""Shipped pilots on their robots, each alone in a calm world, against closed forms."""

import numpy as np
import pytest

from swarm_mj import paper
from swarm_mj.physics.bodies import BodyWorlds
from swarm_mj.physics.pilots import GRAVITY_MPS2, Airframe, QuadrotorPilot, RoverPilot
from swarm_mj.physics.robots import kinds_of
from swarm_mj.system.packages import asset

HEIGHT_M = 20.0


def worlds(robot, num_robots=2, pilot=None, **fields):
    """Worlds of one mission of robots that stand still, far apart."""
    mission = paper("random-walk", robot=robot, num_robots=num_robots, **fields)
    flown = BodyWorlds(mission, 1, pilot=pilot)
    flown.start([np.random.default_rng(0)], [])
    position_m = np.zeros((1, num_robots, 3))
    position_m[0, :, 0] = 50.0 * np.arange(num_robots) - 100.0
    position_m[..., 2] = flown.draw_heights_m(np.random.default_rng(0))
    flown.place(position_m, np.zeros_like(position_m))
    return flown


def course(flown, acceleration_mps2, num_windows):
    """Positions and velocities of robot 0 after each window under one acceleration, then none."""
    acceleration = np.zeros_like(flown.states.position_m)
    acceleration[0, 0] = acceleration_mps2
    seen = []
    for _ in range(num_windows):
        states = flown.step(acceleration)
        acceleration[:] = 0.0
        seen.append((states.position_m[0, 0].copy(), states.velocity_mps[0, 0].copy()))
    return [np.array(each) for each in zip(*seen, strict=True)]


def test_a_quadrotor_hovers_where_it_began():
    flown = worlds("quadrotor")
    position_m, velocity_mps = course(flown, (0.0, 0.0, 0.0), 50)
    np.testing.assert_allclose(position_m[-1], [-100.0, 0.0, HEIGHT_M], atol=1e-6)
    np.testing.assert_allclose(velocity_mps, 0.0, atol=1e-6)


def test_its_rotors_hover_with_its_weight():
    """A quarter of 0.5 kg times g each, once air and lag are at rest."""
    flown = worlds("quadrotor")
    course(flown, (0.0, 0.0, 0.0), 20)
    np.testing.assert_allclose(flown._flown[0].ctrl, 0.25 * 0.5 * 9.81, rtol=1e-6)


def test_it_reaches_a_velocity_as_its_pilot_s_poles_say():
    """A first-order lag of 1 / 2.5 s behind the turn of the body: slower at first."""
    _, velocity_mps = course(worlds("quadrotor"), (10.0, 0.0, 0.0), 40)
    speed = velocity_mps[:, 0]
    assert speed[3] < 1.0 - np.exp(-2.5 * 0.4)  # the body turns first
    assert speed[-1] == pytest.approx(1.0, abs=0.01)
    assert np.max(speed) < 1.25
    np.testing.assert_allclose(velocity_mps[-1, 1:], 0.0, atol=0.01)


def test_it_climbs_when_its_set_point_does_and_stays_there():
    flown = worlds("quadrotor")
    acceleration = np.zeros((1, 2, 3))
    acceleration[0, 0, 2] = 10.0
    flown.step(acceleration)  # 1 m/s upwards
    acceleration[:] = 0.0
    for _ in range(20):
        flown.step(acceleration)
    acceleration[0, 0, 2] = -10.0
    flown.step(acceleration)  # and no more
    acceleration[:] = 0.0
    for _ in range(30):
        flown.step(acceleration)
    assert flown.states.position_m[0, 0, 2] == pytest.approx(HEIGHT_M + 2.1, abs=0.02)
    assert flown.states.position_m[0, 1, 2] == pytest.approx(HEIGHT_M, abs=1e-6)


def test_a_rotor_that_fails_brings_it_down():
    """Without its front rotor a quadrotor turns over; on the floor it has crashed, and is off."""
    flown = worlds("quadrotor", num_robots=3)
    quadrotor = flown._flown[0]

    class Failing:
        def __call__(self, sensed, wanted, control):
            quadrotor.pilot(sensed, wanted, control)
            control[0, 0, 0] = 0.0

    flown._flown[0] = quadrotor._replace(pilot=Failing())
    for _ in range(60):
        flown.step(np.zeros((1, 3, 3)))
    assert flown.states.position_m[0, 0, 2] < 1.0
    assert flown.states.is_active.tolist() == [[False, True, True]]
    np.testing.assert_allclose(flown.states.position_m[0, 1, 2], HEIGHT_M, atol=1e-6)


def drag_mps2(wind_mps):
    """MuJoCo's drag of the box with the quadrotor's inertia, of 0.219, 0.219 and 0.088 m."""
    side_m = np.sqrt(6.0 * 4e-3 / 0.5)
    flat_m = np.sqrt(6.0 * (2 * 2.32e-3 - 4e-3) / 0.5)
    return 0.5 * 1.204 * side_m * flat_m * wind_mps**2 / 0.5


def test_its_steady_speed_in_a_wind_is_the_set_point_less_what_drag_takes():
    """P control: drag over mass, divided by the gain, is what is left of the velocity's error."""
    calm = worlds("quadrotor")
    windy = worlds("quadrotor", wind_mps=5.0)
    course(calm, (0.0, 5.0, 0.0), 60)
    _, velocity_mps = course(windy, (0.0, 5.0, 0.0), 60)
    drift = velocity_mps[-1, 0]
    assert drift == pytest.approx(drag_mps2(5.0 - drift) / 2.5, rel=0.3)
    assert velocity_mps[-1, 1] == pytest.approx(0.5, abs=0.05)
    assert calm.states.velocity_mps[0, 0, 0] == pytest.approx(0.0, abs=1e-6)


def test_a_rover_stands_where_it_began():
    position_m, _ = course(worlds("rover"), (0.0, 0.0, 0.0), 20)
    np.testing.assert_allclose(position_m[-1], [-100.0, 0.0, 0.125], atol=1e-9)


def test_a_rover_never_moves_sideways():
    """In a violent walk it moves along its heading, but for what a step turns it on."""
    flown = worlds("rover", num_robots=20)
    rng = np.random.default_rng(0)
    sideways = []
    for _ in range(100):
        flown.step(rng.normal(0.0, 20.0 / 3.0, (1, 20, 3)))
        states = flown.states
        heading = 2.0 * np.arctan2(states.attitude[..., 3], states.attitude[..., 0])
        across = -np.sin(heading), np.cos(heading)
        sideways.append(
            states.velocity_mps[..., 0] * across[0] + states.velocity_mps[..., 1] * across[1]
        )
    assert np.max(np.abs(sideways)) < 0.05
    assert np.max(np.abs(flown.states.velocity_mps)) > 0.5


def test_a_rover_drives_backwards_where_that_is_nearer():
    flown = worlds("rover")
    _, velocity_mps = course(flown, (-10.0, 0.0, 0.0), 20)
    assert velocity_mps[-1, 0] == pytest.approx(-1.0, abs=0.02)
    heading = 2.0 * np.arctan2(flown.states.attitude[0, 0, 3], flown.states.attitude[0, 0, 0])
    assert abs(heading) < 1e-6


def test_a_rover_turns_in_the_circle_that_its_speed_and_turn_rate_make():
    """At a heading error of 90° it stands and turns, at most as fast as it can."""
    flown = worlds("rover")
    _, velocity_mps = course(flown, (0.0, 10.0, 0.0), 5)
    heading = 2.0 * np.arctan2(flown.states.attitude[0, 0, 3], flown.states.attitude[0, 0, 0])
    assert 0.0 < heading <= 4.0 * 0.5  # [rad]: at most 4 rad/s, for half a second
    _, velocity_mps = course(flown, (0.0, 0.0, 0.0), 40)
    np.testing.assert_allclose(velocity_mps[-1], [0.0, 1.0, 0.0], atol=0.02)


@pytest.mark.parametrize(
    ("speed_mps", "turn_rps"), [(1.0, 0.5), (1.0, 1.0), (1.8, 1.0), (1.0, 2.0)]
)
def test_a_rover_s_turn_radius_is_its_speed_over_its_turn_rate(speed_mps, turn_rps):
    """Behind a set point that turns its heading is late by its turn rate over the pilot's gain.

    So it drives at the cosine of that lag, and in a circle that is smaller by it, too.
    """
    flown = worlds("rover", velocity_ratio=0.5)
    wanted_mps = np.zeros((1, 2, 3))
    places_m = []
    for window in range(120):
        before_mps = wanted_mps.copy()
        angle = turn_rps * 0.1 * window
        wanted_mps[0, 0, :2] = speed_mps * np.cos(angle), speed_mps * np.sin(angle)
        states = flown.step((wanted_mps - before_mps) / 0.1)
        places_m.append(states.position_m[0, 0, :2])
    settled_m = np.array(places_m[60:])
    # The circle of least squares: x² + y² = 2 x a + 2 y b + (r² - a² - b²).
    sides = np.column_stack([2.0 * settled_m, np.ones(60)])
    a, b, rest = np.linalg.lstsq(sides, np.sum(settled_m**2, axis=1), rcond=None)[0]
    lag = turn_rps / 3.0
    assert np.sqrt(rest + a**2 + b**2) == pytest.approx(
        speed_mps * np.cos(lag) / turn_rps, rel=0.01
    )


def test_rotors_push_at_their_places():
    """A control of 1 N lifts by 1 N; front and left tip the body about y and x, by their arms."""
    [kind] = kinds_of(paper(robot="quadrotor", num_robots=2))
    front, left, back, right = kind.airframe(0.005).thrust
    np.testing.assert_allclose(front, [0, 0, 1, 0, -0.175, -0.02455], atol=1e-12)
    np.testing.assert_allclose(left, [0, 0, 1, 0.175, 0, 0.02455], atol=1e-12)
    np.testing.assert_allclose(front + back, [0, 0, 2, 0, 0, -0.0491], atol=1e-12)
    np.testing.assert_allclose(left + right, [0, 0, 2, 0, 0, 0.0491], atol=1e-12)


def test_the_pilot_flies_a_quadrotor_of_another_size_and_layout(tmp_path):
    """Four times as heavy, with arms twice as long, and rotors at the corners in another order."""
    text = asset("quadrotor.xml").read_text()
    for old, new in (
        ('mass="0.5" diaginertia="2.32e-3 2.32e-3 4e-3"', 'mass="2" diaginertia="0.03 0.03 0.05"'),
        ('ctrlrange="0.088 3.717"', 'ctrlrange="0 15"'),
        ('name="front" pos="0.175 0 0"', 'name="front" pos="-0.25 0.25 0"'),
        ('name="left" pos="0 0.175 0"', 'name="left" pos="-0.25 -0.25 0"'),
        ('name="back" pos="-0.175 0 0"', 'name="back" pos="0.25 -0.25 0"'),
        ('name="right" pos="0 -0.175 0"', 'name="right" pos="0.25 0.25 0"'),
    ):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "large.xml"
    path.write_text(text)
    flown = worlds(str(path), pilot="swarm_mj.physics.pilots:QuadrotorPilot")
    _, velocity_mps = course(flown, (10.0, 0.0, 0.0), 40)
    np.testing.assert_allclose(velocity_mps[-1], [1.0, 0.0, 0.0], atol=0.02)
    assert flown.states.position_m[0, 0, 2] == pytest.approx(HEIGHT_M, abs=0.05)


def test_pilots_refuse_other_robots():
    [rover] = kinds_of(paper(robot="rover", num_robots=2))
    with pytest.raises(
        ValueError, match="needs four rotors that lift, roll, pitch and turn it, not 3"
    ):
        QuadrotorPilot(rover.airframe(0.005))
    [quadrotor] = kinds_of(paper(robot="quadrotor", num_robots=2))
    with pytest.raises(ValueError, match="needs the actuators drive and steer, not front"):
        RoverPilot(quadrotor.airframe(0.005))
    assert isinstance(quadrotor.airframe(0.005), Airframe)
    assert GRAVITY_MPS2 == 9.81
