"""Lines through obstacles, by hand and by MuJoCo's own rays."""

import mujoco
import numpy as np
import pytest

from swarm_mj.physics.state import BOX, CAPSULE, CYLINDER, ELLIPSOID, SPHERE, Obstacles
from swarm_mj.radio.obstruction import blocked, obstruct, power_through

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
    height_m, radius_m = np.full(len(at_x), 1.0), np.full(len(at_x), 0.5)
    touches = blocked(position_m, height_m, radius_m, boxes((0, 0, 10, 5)))
    assert touches.tolist() == [True, True, True, False, True, False]


def test_a_line_over_a_wall_is_clear():
    """A wall of 5 m: robots at 20 m look over it, those at 2 m do not."""
    wall = boxes((0, 0, 1, 50))
    # Above the wall lines are 20 m, 11 m and 2 m high.
    for first_m, other_m, left in ((20.0, 20.0, 1.0), (20.0, 2.0, 1.0), (2.0, 2.0, 0.1)):
        position_m = np.array([[-30.0, 0.0, first_m], [30.0, 0.0, other_m]])
        power = np.ones(2)
        obstruct(0, position_m, 1.0, wall, power)
        assert power[1] == left
