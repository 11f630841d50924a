"""Mean powers by laws and through obstacles: hand arithmetic, MuJoCo's own rays, sums in dB."""

import math

import mujoco
import numpy as np
import pytest
from walls import walls

from swarm_mj.physics.state import BOX, CAPSULE, CYLINDER, ELLIPSOID, SPHERE, Obstacles
from swarm_mj.radio.free_space import path_loss_db
from swarm_mj.radio.power_law import (
    PowerLaw,
    blocked,
    obstruct,
    power_after,
    power_through,
    powers_between,
    two_ray_breakpoint_m,
)

PLACES_M = np.array([[-30.0, 0.0], [-40.0, 0.0], [30.0, 40.0]])


def test_free_space_is_the_inverse_square_by_hand():
    """10 m, sqrt(60² + 40²) m and sqrt(70² + 40²) m apart; robot 2 sends four times the power."""
    power = powers_between(PLACES_M, PowerLaw(np.array([1.0, 1.0, 4.0])))
    expected = [[0.0, 1 / 100, 1 / 5200], [1 / 100, 0.0, 1 / 6500], [4 / 5200, 4 / 6500, 0.0]]
    np.testing.assert_allclose(power, expected, rtol=1e-12)


def test_a_steeper_law_and_a_wall_by_hand():
    """Beyond 20 m the fourth power: 1/20² (20/d)⁴; a tenth is left behind the wall."""
    law = PowerLaw(np.ones(3), 20.0, 4.0, walls(0.1, 0))
    power = powers_between(PLACES_M, law)
    assert power[0, 1] == pytest.approx(1 / 100)
    assert power[0, 2] == pytest.approx(0.1 * 20.0**2 / 5200.0**2)
    assert power[2, 1] == pytest.approx(0.1 * 20.0**2 / 6500.0**2)


FREQUENCY_HZ = 2.4e9


def loss_db(distance_m, breakpoint_m=math.inf, exponent=2.0):
    """Between transmit power and what is left."""
    at_1_m = 10 ** (-path_loss_db(1.0, FREQUENCY_HZ) / 10)
    return -10 * math.log10(power_after(at_1_m, distance_m**2, breakpoint_m, exponent))


@pytest.mark.parametrize("distance_m", [0.5, 1.0, 250.0, 4000.0])
def test_eq1_free_space_is_the_papers(distance_m):
    assert loss_db(distance_m) == pytest.approx(path_loss_db(distance_m, FREQUENCY_HZ), rel=1e-12)


@pytest.mark.parametrize(("near_m", "slope_db"), [(0.2, 20.0), (20.0, 35.0), (300.0, 35.0)])
def test_log_distance_has_its_slope_beyond_the_breakpoint_and_free_spaces_before(near_m, slope_db):
    slope = loss_db(10 * near_m, 20.0, 3.5) - loss_db(near_m, 20.0, 3.5)
    assert slope == pytest.approx(slope_db)


def test_two_ray_loses_d4_over_h4_beyond_4_pi_h2_over_lambda():
    """Rappaport's Eq. 4.52, with antennas without gain: the loss is d^4 / (h^2 h^2)."""
    wavelength_m = 299_792_458.0 / FREQUENCY_HZ
    breakpoint_m = two_ray_breakpoint_m(1.5, FREQUENCY_HZ)
    assert breakpoint_m == pytest.approx(4 * math.pi * 1.5**2 / wavelength_m)
    expected_db = 10 * math.log10(500.0**4 / 1.5**4)
    assert loss_db(500.0, breakpoint_m, 4.0) == pytest.approx(expected_db, abs=0.01)


KINDS = {
    "sphere": SPHERE,
    "capsule": CAPSULE,
    "ellipsoid": ELLIPSOID,
    "cylinder": CYLINDER,
    "box": BOX,
}


def boxes(*centres_and_halves, power_left=0.1):
    """Upright boxes by centre x, y and half sides x, y [m]."""
    rows = np.array(centres_and_halves, dtype=float)
    num = len(rows)
    return Obstacles(
        kind=np.full(num, BOX),
        centre_m=np.column_stack([rows[:, :2], np.zeros(num)]),
        rotation=np.tile(np.eye(3), (num, 1, 1)),
        size_m=np.column_stack([rows[:, 2:], np.full(num, 5.0)]),
        reach_m=np.linalg.norm(np.column_stack([rows[:, 2:], np.full(num, 5.0)]), axis=1),
        power_left=np.full(num, power_left),
    )


def left(start, end, obstacles):
    along_m = (end[0] - start[0], end[1] - start[1], 0.0)
    return power_through((*start, 1.0), along_m, obstacles)


@pytest.mark.parametrize(
    ("start", "end", "crosses"),
    [
        ((-20.0, 0.0), (20.0, 0.0), True),  # through the middle
        ((-20.0, 4.9), (20.0, 4.9), True),  # just inside the upper side
        ((-20.0, 5.1), (20.0, 5.1), False),  # just above it
        ((-20.0, 0.0), (-10.1, 0.0), False),  # ends just before it
        ((-20.0, 0.0), (-9.9, 0.0), True),  # ends just inside
        ((-20.0, -12.0), (4.0, 12.0), True),  # y = x + 8 meets the corner (-10, -2) to (-3, 5)
        ((-20.0, -3.0), (-4.0, 13.0), False),  # y = x + 17 misses the corner (-10, 5) by 2 m
    ],
)
def test_a_box_is_crossed_where_hand_geometry_says_so(start, end, crosses):
    box = boxes((0.0, 0.0, 10.0, 5.0))
    assert left(start, end, box) == (0.1 if crosses else 1.0)
    assert left(end, start, box) == left(start, end, box)


def test_losses_of_walls_add_up_in_db():
    walls = boxes((10.0, 0.0, 1.0, 50.0), (20.0, 0.0, 1.0, 50.0), (30.0, 0.0, 1.0, 50.0))
    assert left((0.0, 0.0), (25.0, 3.0), walls) == pytest.approx(0.1**2)
    assert left((0.0, 0.0), (35.0, 3.0), walls) == pytest.approx(0.1**3)


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_is_crossed_where_mujocos_rays_meet_it(name):
    rng = np.random.default_rng(KINDS[name])
    for _ in range(10):
        size, turn = rng.uniform(1.0, 8.0, 3), rng.normal(size=4)
        spec = mujoco.MjSpec()
        spec.worldbody.add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}"),
            size=size,
            pos=rng.uniform(-4.0, 4.0, 3),
            quat=turn / np.linalg.norm(turn),
        )
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        obstacles = Obstacles(
            kind=np.array([KINDS[name]]),
            centre_m=data.geom_xpos.copy(),
            rotation=data.geom_xmat.reshape(-1, 3, 3).copy(),
            size_m=model.geom_size.copy(),
            reach_m=model.geom_rbound.copy(),
            power_left=np.array([0.1]),
        )
        for _ in range(30):
            # Both ends outside: MuJoCo's rays do not meet what they begin in from its inside.
            ends_m = rng.normal(size=(2, 3))
            ends_m *= 20.0 / np.linalg.norm(ends_m, axis=1, keepdims=True)
            along_m = ends_m[1] - ends_m[0]
            met = np.zeros(1, dtype=np.int32)
            share = mujoco.mj_ray(model, data, ends_m[0], along_m, None, 1, -1, met)
            crosses = 0.0 <= share <= 1.0
            assert power_through(tuple(ends_m[0]), tuple(along_m), obstacles) == (
                0.1 if crosses else 1.0
            )


def test_only_those_asked_for_lose_power():
    position_m = np.array([[-20.0, 0.0], [20.0, 0.0], [-20.0, 30.0]])
    received_mw = np.ones((3, 3))
    obstruct(0, position_m, 1.0, boxes((0, 0, 10, 5)), received_mw[0])
    np.testing.assert_allclose(received_mw, [[1, 0.1, 1], [1, 1, 1], [1, 1, 1]])


def test_antennas_above_an_obstacle_see_each_other():
    position_m = np.array([[-20.0, 0.0], [20.0, 0.0]])
    received_mw = np.ones((2, 2))
    for i in range(2):
        obstruct(i, position_m, 5.5, boxes((0, 0, 10, 5)), received_mw[i])
    assert np.all(received_mw == 1.0)


def test_robots_are_blocked_where_their_bodies_touch():
    """The box reaches to x = 10 m; a body of 0.5 m touches it up to 10.5 m."""
    at_x = [0.0, 9.0, 10.4, 10.6, -10.4, -10.6]
    position_m = np.array([[x, 0.0] for x in at_x])
    touches = blocked(position_m, 1.0, 0.5, boxes((0, 0, 10, 5)))
    assert touches.tolist() == [True, True, True, False, True, False]
