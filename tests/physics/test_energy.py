"""Energy of robots with bodies against closed forms: hover, work of a force, idling, crashes."""

import math

import numpy as np
import pytest

from swarm_mj import paper
from swarm_mj.physics.bodies import BodyWorlds
from swarm_mj.physics.declarations import Declarations
from swarm_mj.physics.energy import motors_of, use_energy
from swarm_mj.system.packages import asset

WINDOW_S = 0.1
ONE_MOTOR = np.array([1.0])


def worlds_of(mission, velocity_mps=0.0):
    """Robots 20 m apart along x, at the heights where they begin, all equally fast along x."""
    return placed(BodyWorlds(mission, 1), velocity_mps)


def placed(worlds, velocity_mps=0.0):
    """Start such worlds."""
    worlds.start([np.random.default_rng(1)], [])
    position_m = np.zeros_like(worlds.states.position_m)
    position_m[0, :, 0] = 20.0 * np.arange(position_m.shape[1])
    position_m[..., 2] = worlds.draw_heights_m(np.random.default_rng(2))
    velocities_mps = np.zeros_like(position_m)
    velocities_mps[..., 0] = velocity_mps
    worlds.place(position_m, velocities_mps)
    return worlds


def windows(worlds, num_windows, first_mps2=0.0):
    """Fly some windows; in the first one, the set points accelerate along x."""
    acceleration_mps2 = np.zeros_like(worlds.states.position_m)
    acceleration_mps2[..., 0] = first_mps2
    for _ in range(num_windows):
        worlds.step(acceleration_mps2)
        acceleration_mps2[:] = 0.0
    return worlds.states.energy_j[0]


def test_a_hummingbird_of_half_a_kilogram_hovers_with_56_w():
    """4 T^(3/2) / sqrt(2 rho pi r²) / 0.35, each rotor lifting a quarter of 0.5 kg."""
    worlds = worlds_of(paper("stationary", robot="quadrotor", num_robots=2))
    lift_n = 0.5 * 9.81 / 4.0
    ideal_w = 4.0 * lift_n**1.5 / math.sqrt(2.0 * 1.204 * math.pi * 0.1**2)
    assert ideal_w / 0.35 == pytest.approx(56.4, abs=0.1)
    np.testing.assert_allclose(windows(worlds, 10), ideal_w / 0.35 * 10 * WINDOW_S, rtol=1e-6)


def test_its_efficiency_is_that_of_the_lift_and_torque_in_its_file():
    """Of the shaft's torque times its turn rate, at any speed, momentum theory needs 35 %."""
    for rpm in (1200.0, 7800.0):
        lift_n = 6.11e-8 * rpm**2
        shaft_w = 1.5e-9 * rpm**2 * 2.0 * math.pi * rpm / 60.0
        ideal_w = lift_n**1.5 / math.sqrt(2.0 * 1.204 * math.pi * 0.1**2)
        assert ideal_w / shaft_w == pytest.approx(0.35, abs=0.001)


def test_a_rover_that_speeds_up_gains_its_kinetic_energy():
    """m v² / 2 of 17 kg; it stops without giving anything back, and takes little to hold."""
    worlds = worlds_of(paper("stationary", robot="rover", num_robots=2))
    assert windows(worlds, 5).tolist() == [0.0, 0.0]
    used_j = windows(worlds, 40, first_mps2=10.0)
    speed_mps = worlds.states.velocity_mps[0, :, 0]
    np.testing.assert_allclose(speed_mps, 1.0, atol=1e-3)
    np.testing.assert_allclose(used_j, 0.5 * 17.0 * speed_mps**2, rtol=0.02)
    stopped_j = windows(worlds, 40, first_mps2=-10.0)
    np.testing.assert_allclose(worlds.states.velocity_mps[0, :, 0], 0.0, atol=0.02)
    np.testing.assert_allclose(stopped_j, used_j, rtol=0.05)


def test_who_crashed_uses_no_more():
    worlds = worlds_of(paper("stationary", robot="quadrotor", num_robots=3))
    before_j = windows(worlds, 2).copy()
    worlds._has_crashed[0, 1] = True
    after_j = windows(worlds, 2)
    assert after_j[1] == before_j[1]
    assert np.all(after_j[[0, 2]] > before_j[[0, 2]])


def test_energy_begins_anew_with_each_mission():
    worlds = worlds_of(paper("stationary", robot="quadrotor", num_robots=2))
    windows(worlds, 2)
    worlds.place(worlds.states.position_m, worlds.states.velocity_mps)
    assert worlds.states.energy_j.tolist() == [[0.0, 0.0]]


STEP_S = 0.005


def used(motors, force_n, speed_mps):
    """The energy of one step of one robot."""
    energy_j = np.zeros((1, 1))
    of_robot = [np.array([[each]], dtype=float) for each in (force_n, speed_mps)]
    use_energy(motors, *of_robot, np.zeros((1, 1), dtype=bool), energy_j)
    return energy_j[0, 0]


def test_a_drive_takes_force_times_speed_over_its_efficiency_and_brakes_for_nothing():
    declared = Declarations(efficiency=0.8, idle_power_w=30.0)
    motors = motors_of(np.array([1.0, 0.0]), declared, STEP_S, 1.204)
    assert used(motors, [10.0, -4.0], [2.0, -3.0]) == pytest.approx(
        STEP_S * (30.0 + (20.0 + 12.0) / 0.8)
    )
    assert used(motors, [10.0, -4.0], [-2.0, 3.0]) == pytest.approx(STEP_S * 30.0)


def test_what_is_servoed_on_a_robot_with_rotors_is_no_rotor():
    declared = Declarations(efficiency=0.5, rotor_radius_m=0.2)
    motors = motors_of(np.array([1.0, 0.0]), declared, STEP_S, 1.0)
    rotor_w = 9.0**1.5 / math.sqrt(2.0 * math.pi * 0.04)
    expected_j = STEP_S * (rotor_w + 6.0) / 0.5
    assert used(motors, [-9.0, 3.0], [100.0, 2.0]) == pytest.approx(expected_j)


def test_a_model_without_efficiency_says_nothing():
    assert motors_of(ONE_MOTOR, Declarations(), STEP_S, 1.204) is None


def test_a_rotor_is_known_by_what_it_lifts_after_its_gear(tmp_path):
    """The quadrotor with its scale in the gears, and a hinge that lifts nothing, takes as much."""
    text = asset("quadrotor.xml").read_text()
    text = text.replace('gear="0 0 1 0 0 -0.02455"', 'gear="0 0 .001 0 0 -0.00002455"')
    text = text.replace('gear="0 0 1 0 0 0.02455"', 'gear="0 0 .001 0 0 0.00002455"')
    text = text.replace('ctrlrange="0.088 3.717"', 'ctrlrange="88 3717"')
    geared = tmp_path / "geared.xml"
    geared.write_text(text)
    pilot = "swarm_mj.physics.pilots:QuadrotorPilot"
    mission = paper("stationary", robot=str(geared), num_robots=2)
    worlds = placed(BodyWorlds(mission, 1, pilot=pilot))
    plain = worlds_of(paper("stationary", robot="quadrotor", num_robots=2))
    np.testing.assert_allclose(windows(worlds, 5), windows(plain, 5), rtol=1e-6)
