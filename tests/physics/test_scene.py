import mujoco
import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.physics.scene import (
    BEACON_RADIUS_M,
    ROBOT_MASS_KG,
    SQUARES_PER_M,
    WALL_HALF_HEIGHT_M,
    WALL_HALF_THICKNESS_M,
    compose,
    num_substeps,
    timestep_s,
)
from swarm_mj.physics.state import ROBOT_RADIUS_M, RobotStates
from swarm_mj.system.packages import asset

# Half the side of the square in which 40 robots share a square kilometre, by hand [m].
HALF_SIDE_M = {10: 250.0, 40: 500.0, 90: 750.0}
MODES = ["exact", "contact"]
WALLS = ["wall_east", "wall_west", "wall_north", "wall_south"]


def compiled(num_robots, physics="exact", boundary="reflect", **numbers):
    mission = paper(
        "random-walk", num_robots=num_robots, physics=physics, boundary=boundary, **numbers
    )
    return compose(mission).compile()


def geom_names(model):
    return {model.geom(g).name for g in range(model.ngeom)}


def test_assets_alone_equal_the_default_scene():
    """Composing the paper's mission changes no number of the two files."""
    arena = mujoco.MjModel.from_xml_path(str(asset("arena.xml")))
    robot = mujoco.MjModel.from_xml_path(str(asset("robot.xml")))
    model = compiled(40)
    for name in ("floor", *WALLS):
        np.testing.assert_allclose(model.geom(name).size, arena.geom(name).size)
        np.testing.assert_allclose(model.geom(name).pos, arena.geom(name).pos)
    np.testing.assert_allclose(model.camera("top").pos, arena.camera("top").pos)
    np.testing.assert_allclose(model.mat_texrepeat[model.material("floor").id], 5.0)
    assert model.stat.extent == arena.stat.extent
    for column in ("ctrlrange", "forcerange", "gainprm", "biasprm"):
        one = getattr(robot, f"actuator_{column}")
        np.testing.assert_allclose(getattr(model, f"actuator_{column}"), np.tile(one, (40, 1)))


@pytest.mark.parametrize("physics", MODES)
@pytest.mark.parametrize("num_robots", HALF_SIDE_M)
def test_composed_team_is_n_point_masses_in_the_plane(num_robots, physics):
    model = compiled(num_robots, physics)
    assert model.nq == model.nv == model.nu == 2 * num_robots
    np.testing.assert_array_equal(model.body_mass[1:], 1.0)
    for i in range(num_robots):
        for axis, joint in enumerate("xy"):
            # Physics reads and writes qpos, qvel and ctrl as [robot, axis].
            assert model.joint(f"r{i}/{joint}").qposadr == 2 * i + axis
            assert model.joint(f"r{i}/{joint}").dofadr == 2 * i + axis
            assert model.actuator(f"r{i}/v{joint}").id == 2 * i + axis
            assert model.actuator(f"r{i}/v{joint}").trnid[0] == model.joint(f"r{i}/{joint}").id
            np.testing.assert_array_equal(model.joint(f"r{i}/{joint}").axis, np.eye(3)[axis])
    assert np.all(model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE)


@pytest.mark.parametrize("num_robots", HALF_SIDE_M)
def test_iv_b_area_grows_with_the_team(num_robots):
    """At 40 robots per square kilometre: the floor's edges and the walls' inner faces."""
    model = compiled(num_robots)
    half_m = HALF_SIDE_M[num_robots]
    np.testing.assert_allclose(model.geom("floor").size[:2], half_m)
    for name, axis, sign in zip(WALLS, (0, 0, 1, 1), (1, -1, 1, -1), strict=True):
        wall = model.geom(name)
        inner_face_m = sign * wall.pos[axis] - wall.size[axis]
        assert inner_face_m == pytest.approx(half_m)
        assert wall.pos[1 - axis] == 0.0
        assert wall.size[1 - axis] >= half_m + 2 * wall.size[axis] - 1e-9  # the corners are closed
        assert wall.pos[2] == pytest.approx(wall.size[2])  # it stands on the floor
    assert model.stat.extent == pytest.approx(2 * half_m)
    squares = 2 * model.mat_texrepeat[model.material("floor").id]  # two per repeat
    np.testing.assert_allclose(2 * half_m / squares, 100.0)


@pytest.mark.parametrize("physics", MODES)
def test_a_viewer_opens_on_the_start_and_its_keyframe_flies_on(tmp_path, physics):
    """One window after the keyframe, every robot is where its velocity took it in 100 ms."""
    mission = paper("random-walk", num_robots=3, physics=physics)
    start = RobotStates(
        position_m=np.array([[[-120.5, 30.0], [0.0, 110.25], [99.0, -1.5]]]),
        velocity_mps=np.array([[[1.5, -2.0], [0.0, 0.5], [-3.0, 0.0]]]),
    )
    path = tmp_path / "scene.xml"
    path.write_text(compose(mission, start).to_xml())
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for i in range(3):
        np.testing.assert_allclose(data.body(f"r{i}/body").xpos[:2], start.position_m[0, i])
    np.testing.assert_allclose(data.qpos.reshape(3, 2), start.position_m[0])
    assert model.key(0).name == "start"
    mujoco.mj_resetDataKeyframe(model, data, 0)
    np.testing.assert_allclose(data.qpos.reshape(3, 2), start.position_m[0])
    mujoco.mj_step(model, data, num_substeps(mission))
    moved_m = start.position_m[0] + 0.1 * start.velocity_mps[0]
    np.testing.assert_allclose(data.qpos.reshape(3, 2), moved_m)


def test_python_and_the_files_of_mjcf_agree():
    """Python repeats these sizes, as arrays are made of them without MuJoCo."""
    robot = mujoco.MjModel.from_xml_path(str(asset("robot.xml")))
    assert robot.geom("hull").size[0] == ROBOT_RADIUS_M
    assert robot.geom("beacon").size[0] == BEACON_RADIUS_M
    assert robot.body("body").mass == ROBOT_MASS_KG
    arena = mujoco.MjModel.from_xml_path(str(asset("arena.xml")))
    size_m = arena.geom("wall_east").size
    assert (size_m[0], size_m[2]) == (WALL_HALF_THICKNESS_M, WALL_HALF_HEIGHT_M)
    repeats = arena.material("floor").texrepeat
    np.testing.assert_allclose(repeats, 2 * arena.geom("floor").size[:2] * SQUARES_PER_M)


@pytest.mark.parametrize("num_robots", [2, 10, 40, 90, 160])
def test_camera_sees_the_whole_area(num_robots):
    """Projects the area's corners, at the robots' height, into the camera's square image."""
    model = compiled(num_robots)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    half_m = 500.0 * (num_robots / 40.0) ** 0.5
    to_camera = data.camera("top").xmat.reshape(3, 3).T
    half_view = np.tan(np.deg2rad(model.camera("top").fovy[0] / 2.0))
    for x_m, y_m in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        corner_m = np.array([x_m * half_m, y_m * half_m, 1.0])
        right, up, behind = to_camera @ (corner_m - data.camera("top").xpos)
        depth_m = -behind  # MuJoCo's cameras look along their negative z axis
        assert model.vis.map.znear < depth_m / model.stat.extent < model.vis.map.zfar
        # The image holds the area, and the area fills most of the image, east to the right.
        assert 0.8 < x_m * right / depth_m / half_view <= 1.0
        assert 0.8 < y_m * up / depth_m / half_view <= 1.0


@pytest.mark.parametrize(
    ("window_s", "steps"), [(0.1, 10), (0.05, 5), (0.01, 1), (0.014, 2), (0.25, 25), (2.0, 200)]
)
def test_steps_fill_the_window(window_s, steps):
    exact = paper(window_s=window_s)
    assert (num_substeps(exact), timestep_s(exact)) == (1, window_s)
    contact = paper(window_s=window_s, physics="contact")
    assert num_substeps(contact) == steps
    assert steps * timestep_s(contact) == pytest.approx(window_s)


def test_a_scene_is_part_of_the_model_and_of_the_file():
    def pillar(spec, mission):
        size = [mission.side_m / 100.0, 3.0, 0.0]
        spec.worldbody.add_geom(name="pillar", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=size)

    mission = paper(num_robots=3)
    assert compose(mission).geom("pillar") is None
    spec = compose(mission, scene=pillar)
    assert spec.compile().geom("pillar").size[0] == mission.side_m / 100.0
    assert 'name="pillar"' in spec.to_xml()


def test_a_scene_may_not_add_what_moves():
    def ball(spec, _mission):
        spec.worldbody.add_body(name="ball").add_freejoint(name="rolls")

    with pytest.raises(ValueError, match=r"adds .*; scenes may add only static geometry"):
        compose(paper(num_robots=3), scene=ball)


def test_a_scene_changes_neither_the_time_nor_exact_physics():
    def careless(spec, _mission):
        spec.option.timestep = 1.0
        spec.option.disableflags = 0

    spec = compose(paper(num_robots=3), scene=careless)
    assert spec.option.timestep == pytest.approx(0.1)
    assert spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT


def test_robots_that_collide_come_no_farther_in_a_step_than_a_radius_together():
    for velocity_ratio, slowest in ((0.15, 10), (5.0, 40)):  # 3 m/s and 100 m/s per axis
        mission = paper("random-walk", collide=True, velocity_ratio=velocity_ratio)
        assert num_substeps(mission) == slowest
        assert 2.0 * mission.max_velocity_mps * timestep_s(mission) <= ROBOT_RADIUS_M + 1e-9


def test_a_scene_cannot_switch_the_solver_s_parts_off():
    def without_limits(spec, _mission):
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)

    mission = paper("random-walk", num_robots=3, physics="contact")
    spec = compose(mission, scene=without_limits)
    assert not spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_LIMIT


def test_an_arena_s_file_cannot_change_robots_hulls(tmp_path):
    """Its defaults and its own parts of these names are its own."""
    file = tmp_path / "lab.xml"
    file.write_text(
        '<mujoco><default><geom size="10"/></default><worldbody>'
        '<geom name="r0/hull" type="sphere" pos="50 0 5" group="1"/></worldbody></mujoco>'
    )
    model = compose(paper("random-walk", num_robots=3, arena=str(file))).compile()
    assert model.geom("r0/hull").size[0] == ROBOT_RADIUS_M
    assert model.geom("arena/r0/hull").size[0] == 10.0
