from dataclasses import replace

import numpy as np
import pytest
from mujoco import mjtEq, mjtGeom

from swarm_mj.mission import paper, reference
from swarm_mj.physics.state import RobotStates
from swarm_mj.physics.worlds import PointWorlds
from swarm_mj.policies.tdma import Tdma
from swarm_mj.simulation.swarm import Swarm

NUM_MISSIONS, NUM_ROBOTS = 6, 10
BODY_RADIUS_M = 0.5  # assets/robot.xml
MODES = ["exact", "contact"]
RATIOS = [0.05, 0.15, 1.0]  # 1, 3 and 20 m/s


def crowded(physics="exact", preset=paper, **numbers):
    """Ten robots on 100 m by 100 m, so that a flight of 500 windows meets the walls often."""
    return preset(
        "random-walk", num_robots=NUM_ROBOTS, density_per_km2=1000.0, physics=physics, **numbers
    )


def drawn(mission, num_windows, seed=0, num_missions=NUM_MISSIONS):
    """A start inside the area, and accelerations of which some exceed A_max."""
    rng = np.random.default_rng(seed)
    shape = (num_missions, mission.num_robots, 2)
    position_m = rng.uniform(-mission.half_side_m, mission.half_side_m, size=shape)
    velocity_mps = rng.uniform(-1, 1, size=shape) * mission.max_velocity_mps
    wanted = rng.normal(scale=mission.max_acceleration_mps2 / 2, size=(num_windows, *shape))
    return position_m, velocity_mps, wanted


def placed(mission, position_m, velocity_mps, **options):
    """Worlds that begin so."""
    worlds = PointWorlds(mission, len(position_m), **options)
    worlds.place(position_m, velocity_mps)
    return worlds


def flown(mission, position_m, velocity_mps, wanted):
    """The states after each window."""
    worlds = placed(mission, position_m, velocity_mps)
    return [worlds.step(u) for u in wanted]


def eq15(mission, p, v, u, at_wall):
    """One window on paper: drift with the old velocity, kick, clip, and then the wall."""
    p = p + v * 0.1
    v = v + np.clip(u, -mission.max_acceleration_mps2, mission.max_acceleration_mps2) * 0.1
    v = np.clip(v, -mission.max_velocity_mps, mission.max_velocity_mps)
    edge_m = np.copysign(mission.half_side_m, p)
    is_hit = (np.abs(p) > mission.half_side_m) & (at_wall != "open")
    bounced = 2 * edge_m - p if at_wall == "mirror" else edge_m
    return np.where(is_hit, bounced, p), np.where(is_hit, -v, v), is_hit.sum()


def worst_deviation(mission, at_wall):
    """Largest distance from Eq. 15 over 500 windows [m], [m/s], and the walls hit on the way."""
    p, v, wanted = drawn(mission, 500)
    states = flown(mission, p, v, wanted)
    off_m = off_mps = num_hits = 0
    for u, body in zip(wanted, states, strict=True):
        p, v, hits = eq15(mission, p, v, u, at_wall)
        off_m = max(off_m, np.abs(body.position_m - p).max())
        off_mps = max(off_mps, np.abs(body.velocity_mps - v).max())
        num_hits += hits
    return off_m, off_mps, num_hits


def assert_same_states(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.position_m, b.position_m)
        np.testing.assert_array_equal(a.velocity_mps, b.velocity_mps)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize(
    ("at_wall", "fields"),
    [
        ("mirror", {}),
        ("clip", {"preset": reference}),  # onto the wall that it crossed
        ("open", {"boundary": "none"}),
        ("open", {"preset": reference, "boundary": "none"}),
    ],
)
def test_eq15_exact(at_wall, fields, ratio):
    mission = crowded(velocity_ratio=ratio, **fields)
    off_m, off_mps, num_hits = worst_deviation(mission, at_wall)
    assert num_hits > 50 or at_wall == "open"
    assert off_m < 1e-9
    assert off_mps < 1e-9


class NoSteps:
    """Stands in for MuJoCo's worlds and does not step them."""

    def step(self):
        """Nothing moves."""


@pytest.mark.parametrize("physics", MODES)
def test_position_only_moves_because_mujoco_steps(physics):
    mission = crowded(physics)
    p, v, wanted = drawn(mission, 10)
    worlds = placed(mission, p, v)
    worlds._batch = NoSteps()
    for u in wanted:
        np.testing.assert_array_equal(worlds.step(u).position_m, p)
    # In `exact` the next set point is still computed; MuJoCo just never gets to follow it.
    assert np.any(worlds.states.velocity_mps != v) == (physics == "exact")


@pytest.mark.parametrize("physics", MODES)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_acceleration_that_is_not_finite_changes_nothing(physics, value):
    mission = crowded(physics)
    p, v, wanted = drawn(mission, 6)
    worlds = placed(mission, p, v)
    states = [worlds.step(u) for u in wanted[:3]]
    bad = wanted[3].copy()
    bad[2, 4, 1] = value
    with pytest.raises(ValueError, match=rf"finite, not \(.*{value:g}\).*robot 4 in mission 2"):
        worlds.step(bad)
    assert worlds.states is states[-1]
    states += [worlds.step(u) for u in wanted[3:]]
    assert_same_states(states, flown(mission, p, v, wanted))


@pytest.mark.parametrize("physics", MODES)
def test_threads_change_nothing(physics):
    mission = crowded(physics)
    p, v, wanted = drawn(mission, 20)
    worlds = placed(mission, p, v, num_threads=2)
    assert_same_states([worlds.step(u) for u in wanted], flown(mission, p, v, wanted))


@pytest.mark.parametrize("physics", MODES)
def test_place_starts_anew(physics):
    """The second flight of the same worlds is the first one again, bit by bit, from time 0."""
    mission = crowded(physics)
    p, v, wanted = drawn(mission, 60)
    worlds = placed(mission, p, v)
    first = [worlds.step(u) for u in wanted]
    worlds.place(p, v)
    np.testing.assert_array_equal(worlds._batch.bind("time"), 0.0)
    np.testing.assert_array_equal(worlds.states.position_m, p)
    np.testing.assert_array_equal(worlds.states.velocity_mps, v)
    assert_same_states([worlds.step(u) for u in wanted], first)


@pytest.mark.parametrize("physics", MODES)
def test_bodies_are_not_changed_by_later_steps(physics):
    mission = crowded(physics)
    p, v, wanted = drawn(mission, 3)
    worlds = placed(mission, p, v)
    states = [worlds.states] + [worlds.step(u) for u in wanted[:2]]
    kept = [(s.position_m.copy(), s.velocity_mps.copy()) for s in states]
    p[:], v[:] = 0.0, 0.0  # nor by their owner
    worlds.step(wanted[2])
    for state, (position_m, velocity_mps) in zip(states, kept, strict=True):
        np.testing.assert_array_equal(state.position_m, position_m)
        np.testing.assert_array_equal(state.velocity_mps, velocity_mps)


@pytest.mark.parametrize("ratio", RATIOS)
def test_contact_conserves_speed_at_a_wall(ratio):
    """Robots coast into the walls and corners from all sides; every component comes back whole."""
    mission = crowded("contact", velocity_ratio=ratio)
    p, v, wanted = drawn(mission, 500)
    last = v
    num_turns = 0
    for body in flown(mission, p, v, np.zeros_like(wanted)):
        np.testing.assert_allclose(np.abs(body.velocity_mps), np.abs(v), rtol=0.01)
        num_turns += np.sum(body.velocity_mps * last < 0)
        last = body.velocity_mps
    assert num_turns > 10


@pytest.mark.parametrize("ratio", RATIOS)
def test_contact_stays_inside_and_within_both_bounds(ratio):
    mission = crowded("contact", velocity_ratio=ratio)
    p, v, wanted = drawn(mission, 500)
    wanted[:250, 0] = 100.0  # one team leans on a corner with all it has, then is dragged off
    wanted[250:, 0] = -100.0
    wall_m = 50.0
    far_m = wall_m - 2 * mission.max_velocity_mps * 0.1  # cannot reach a wall within a window
    limit_mps = ratio * 20.0
    before = RobotStates(position_m=p, velocity_mps=v)
    for body in flown(mission, p, v, wanted):
        assert np.abs(body.position_m).max() < wall_m + BODY_RADIUS_M
        assert np.abs(body.velocity_mps).max() <= limit_mps
        # Nor is it faster within the window, say after a bounce; those are elastic to 1e-5.
        travelled_m = np.abs(body.position_m - before.position_m)
        assert travelled_m.max() <= limit_mps * 0.1 * (1 + 1e-4)
        is_far = np.abs(before.position_m) < far_m
        kick = np.abs(body.velocity_mps - before.velocity_mps)[is_far] / 0.1
        assert kick.max(initial=0.0) <= 20.0 * (1 + 1e-9)
        before = body


@pytest.mark.parametrize("ratio", RATIOS)
def test_eq15_contact_deviates_by_the_shape_of_the_window_only(ratio):
    """Without walls the lag behind Eq. 15 telescopes to T (n+1) / (2n) (v_t - v_0), n = 10.

    A robot's n steps within a window of T move it with the velocity after each step, Eq. 15 with
    the velocity before the window; the velocities themselves are equal.
    """
    mission = crowded("contact", velocity_ratio=ratio, boundary="none")
    p, v, wanted = drawn(mission, 500)
    v_0 = v
    limit_m = 2 * mission.max_velocity_mps * 0.1 * 11 / 20
    for u, body in zip(wanted, flown(mission, p, v, wanted), strict=True):
        p, v, _ = eq15(mission, p, v, u, "open")
        lag_m = body.position_m - p
        np.testing.assert_allclose(body.velocity_mps, v, atol=1e-9)
        np.testing.assert_allclose(lag_m, 0.1 * 11 / 20 * (v - v_0), atol=1e-8)
        assert np.abs(lag_m).max() <= limit_m + 1e-9


def wall_across(spec, _mission):
    spec.worldbody.add_geom(name="across", type=mjtGeom.mjGEOM_BOX, size=[5.0, 500.0, 5.0])


@pytest.mark.parametrize(("physics", "is_stopped"), [("exact", False), ("contact", True)])
def test_what_a_scene_adds_stops_robots_in_contact_physics_only(physics, is_stopped):
    """A wall 10 m thick through the middle; robots of 0.5 m start 20 m west of it at 3 m/s."""
    mission = paper("random-walk", num_robots=2, physics=physics)
    start_m, start_mps = np.array([[[-25.0, 0.0], [-25.0, 50.0]]]), np.array([[[3.0, 0.0]] * 2])
    worlds = placed(mission, start_m, start_mps, scene=wall_across)
    for _ in range(200):  # 60 m if nothing stops them
        states = worlds.step(np.array([[[20.0, 0.0]] * 2]))
    expected = -5.0 - 0.5 if is_stopped else 35.0
    np.testing.assert_allclose(states.position_m[0, :, 0], expected, atol=0.1)


def heavier(spec, _mission):
    spec.geom("r0/hull").mass = 5.0


def with_a_load(spec, _mission):
    spec.body("r0/body").add_geom(type=mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])


def coupled(spec, _mission):
    spec.add_equality(type=mjtEq.mjEQ_JOINT, name1="r0/x", name2="r1/x")


@pytest.mark.parametrize("scene", [heavier, with_a_load, coupled])
def test_a_scene_that_makes_robots_heavier_or_ties_them_is_refused(scene):
    with pytest.raises(ValueError, match=r"must leave how robots move.*mass=0"):
        PointWorlds(crowded(), 1, scene=scene)


def test_a_scene_may_add_what_weighs_nothing_to_robots():
    def with_a_flag(spec, _mission):
        spec.body("r0/body").add_geom(type=mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1], mass=0.0)

    mission = crowded()
    start_m, start_mps, (wanted,) = drawn(mission, 1)
    plain, flagged = (
        placed(mission, start_m, start_mps, scene=scene).step(wanted)
        for scene in (None, with_a_flag)
    )
    np.testing.assert_array_equal(flagged.position_m, plain.position_m)


def test_robots_meet_what_a_scene_adds_but_no_other_robot():
    """Two robots drive through each other, with and without a scene, on the same ways."""
    mission = paper("random-walk", num_robots=2, physics="contact")
    ends = []
    for scene in (None, wall_across):
        start_m = np.array([[[100.0, 0.0], [106.0, 0.0]]])
        start_mps = np.array([[[3.0, 0.0], [-3.0, 0.0]]])
        worlds = placed(mission, start_m, start_mps, scene=scene)
        for _ in range(20):
            states = worlds.step(np.zeros((1, 2, 2)))
        ends.append(states.position_m)
    np.testing.assert_array_equal(*ends)
    np.testing.assert_allclose(ends[0][0, :, 0], [106.0, 100.0], atol=1e-6)


def collided(*states):
    """Velocities of robots that collide, from (x, y, vx, vy) each, after 2 s, and before."""
    now = np.array([states])
    mission = paper("random-walk", num_robots=len(states), collide=True)
    worlds = placed(mission, now[..., :2].copy(), now[..., 2:].copy())
    for _ in range(20):
        after = worlds.step(np.zeros((1, len(states), 2)))
    return after.velocity_mps[0], now[0, :, 2:]


def test_a_collision_keeps_momentum_and_energy_and_what_is_across():
    """Centres 0.5 m off each other's line: the bodies of 1 m meet at 30 degrees to it."""
    after, before = collided((0.0, 0.0, 3.0, 0.0), (4.0, 0.5, 0.0, 0.0))
    np.testing.assert_allclose(after.sum(axis=0), before.sum(axis=0), atol=1e-9)
    assert np.sum(after**2) == pytest.approx(np.sum(before**2), rel=1e-3)
    turned = np.arctan2(after[1, 1], after[1, 0])  # the other flies off along the line of centres
    assert turned == pytest.approx(np.pi / 6.0, abs=0.05)
    assert after[0] @ after[1] == pytest.approx(0.0, abs=0.02)  # at right angles, as in billiards


@pytest.mark.parametrize("velocity_ratio", [0.5, 5.0])
def test_a_crowd_that_collides_keeps_its_energy_and_nobody_is_in_another(velocity_ratio):
    """20 robots on 45 m by 45 m, at 5 m/s per axis and at 50."""
    mission = crowded("contact", velocity_ratio=velocity_ratio, collide=True)
    mission = replace(mission, num_robots=20, density_per_km2=10_000.0)
    rng = np.random.default_rng(2)
    grid_m = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(1, -1, 2) * 8.0 - 15
    start_mps = rng.uniform(-0.5, 0.5, grid_m.shape) * mission.max_velocity_mps
    worlds = placed(mission, grid_m, start_mps)
    num_changes, last = 0, start_mps
    for _ in range(200):
        states = worlds.step(np.zeros_like(grid_m))
        apart_m = np.linalg.norm(states.position_m[0][:, None] - states.position_m[0], axis=-1)
        apart_m[np.diag_indices(20)] = np.inf
        assert apart_m.min() > 2 * BODY_RADIUS_M - 1.5 * mission.max_velocity_mps * 0.01
        num_changes += np.sum(np.abs(np.abs(states.velocity_mps) - np.abs(last)) > 1e-6)
        last = states.velocity_mps
    assert num_changes > 20  # other than at the boundary, which only turns signs
    fastest = np.abs(last).max() >= mission.max_velocity_mps * (1 - 1e-9)
    assert fastest or np.sum(last**2) == pytest.approx(np.sum(start_mps**2), rel=1e-3)


def hall(half_m):
    """MJCF of walls in which robots of 0.5 m turn where the boundary would turn them."""
    far_m = half_m + BODY_RADIUS_M + 2.0
    walls = [(far_m, 0, 2, 900), (-far_m, 0, 2, 900), (0, far_m, 900, 2), (0, -far_m, 900, 2)]
    geoms = (
        f'<geom type="box" group="1" pos="{x} {y} 5" size="{w} {h} 5"/>' for x, y, w, h in walls
    )
    return f"<mujoco><worldbody>{''.join(geoms)}</worldbody></mujoco>"


@pytest.mark.parametrize("task", ["random-walk", "flocking"])
def test_a_walker_and_a_flock_turn_round_at_walls_as_at_the_boundary(task, tmp_path):
    """The same seed between walls and in the bounded area: the same ways, to a few millimetres."""
    fast = {"num_robots": 5, "density_per_km2": 400.0, "velocity_ratio": 1.0, "physics": "contact"}
    bounded = paper(task, boundary="reflect", **fast)
    file = tmp_path / "hall.xml"
    file.write_text(hall(bounded.half_side_m))
    swarms = [
        Swarm(mission, [1, 2, 3])
        for mission in (bounded, paper(task, boundary="none", arena=str(file), **fast))
    ]
    policy, num_turns = Tdma(), 0
    for _ in range(100):
        before = swarms[0].states.velocity_mps
        for swarm in swarms:
            swarm.step(policy)
        one, other = (swarm.states for swarm in swarms)
        np.testing.assert_allclose(other.position_m, one.position_m, atol=0.05)
        num_turns += np.sum((one.velocity_mps * before < 0) & (np.abs(before) > 5.0))
    assert num_turns > 3


class CountsSteps:
    """MuJoCo's worlds, and how often they were stepped."""

    def __init__(self, worlds):
        self.worlds, self.num_steps = worlds, 0

    def step(self):
        self.worlds.step()
        self.num_steps += 1


@pytest.mark.parametrize("arena", ["open", "blocks"])
def test_a_team_at_rest_is_not_stepped_and_is_where_steps_would_leave_it(arena):
    mission = paper("stationary", num_robots=10, arena=arena, physics="contact")
    position_m = np.linspace(-240.0, -221.0, 20).reshape(1, 10, 2)
    still, pushed = np.zeros_like(position_m), np.zeros_like(position_m)
    pushed[0, 3, 0] = 1.0
    ends = []
    for scene in (None, lambda _spec, _mission: None):  # a scene's worlds are always stepped
        worlds = placed(mission, position_m, still, scene=scene)
        worlds._batch = CountsSteps(worlds._batch)
        num_steps = []
        for push in (still, still, pushed, still):
            worlds.step(push)
            num_steps.append(worlds._batch.num_steps)
        assert num_steps == ([0, 0, 10, 20] if scene is None else [10, 20, 30, 40])
        ends.append(worlds.states.position_m)
    np.testing.assert_array_equal(*ends)
