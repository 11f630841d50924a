"""Shipped arenas grow with the team; which geoms of a scene are obstacles, and what they cost."""

import os
import re
from dataclasses import replace
from itertools import combinations, groupby
from pathlib import Path

import mujoco
import numpy as np
import pytest

from swarm_mj.mission import PRESETS, paper, reference
from swarm_mj.physics.arenas import ARENAS, notes_on
from swarm_mj.physics.materials import DEFAULT_LOSS_DB, MATERIALS
from swarm_mj.physics.obstacles import OBSTACLE_GROUP, obstacle_geoms, obstacles_of
from swarm_mj.physics.scene import compose
from swarm_mj.physics.state import BOX, ROBOT_HEIGHT_M, ROBOT_RADIUS_M, SPHERE
from swarm_mj.policies import make_policy
from swarm_mj.radio.obstruction import blocked
from swarm_mj.simulation.swarm import Swarm

WITH_OBSTACLES = [name for name in ARENAS if name != "open"]
PILLAR = f"""<mujoco><worldbody>
  <geom name="pillar" type="cylinder" size="20 5" pos="0 0 5" group="{OBSTACLE_GROUP}"/>
</worldbody></mujoco>"""


def obstacles(mission):
    return obstacles_of(compose(mission).compile())


@pytest.mark.parametrize(("arena", "num"), [("blocks", 25), ("forest", 100)])
def test_40_robots_have_so_many_obstacles_on_their_square_kilometre(arena, num):
    assert len(obstacles(paper(arena=arena)).kind) == num


@pytest.mark.parametrize("arena", WITH_OBSTACLES)
def test_arenas_grow_with_the_team_and_keep_within_the_area(arena):
    small, large = (paper(arena=arena, num_robots=n) for n in (40, 160))
    assert len(obstacles(large).kind) > 2 * len(obstacles(small).kind)
    for mission in (small, large):
        found = obstacles(mission)
        assert np.all(np.abs(found.centre_m[:, :2]) <= mission.half_side_m)


@pytest.mark.parametrize("arena", WITH_OBSTACLES)
def test_robots_stay_out_of_obstacles_and_never_stop(arena):
    """Within a body radius: a robot's middle never enters; it turns round and keeps its speed."""
    fast = {"velocity_ratio": 0.6, "range_ratio": 0.6}
    mission = paper("random-walk", arena=arena, num_robots=20, num_windows=500, **fast)
    swarm = Swarm(mission, [1, 2])
    found, policy = obstacles(mission), make_policy("tdma", mission)
    num_touches = 0
    for _ in range(mission.num_windows):
        swarm.step(policy)
        position_m = swarm.states.position_m.reshape(-1, 2)
        height_m = np.full(len(position_m), ROBOT_HEIGHT_M)
        radius_m = np.full(len(position_m), ROBOT_RADIUS_M)
        assert not np.any(blocked(position_m, height_m, 2e-3 * radius_m, found))
        num_touches += np.sum(blocked(position_m, height_m, radius_m, found))
    assert num_touches > 0  # somebody was turned round


@pytest.mark.parametrize("preset", [paper, reference])
def test_arenas_fly_in_contact_physics_and_flocks_have_a_boundary(preset):
    mission = preset("flocking", arena="blocks")
    assert (mission.physics, mission.boundary) == ("contact", "reflect")
    with pytest.raises(ValueError, match=r"choose physics contact, or arena open"):
        preset("flocking", arena="blocks", physics="exact")


def test_losses_of_a_file_are_kept_without_a_word(tmp_path, recwarn):
    file = tmp_path / "pillar.xml"
    file.write_text(PILLAR.replace('group="1"', 'group="1" user="3"'))
    assert (-10 * np.log10(obstacles(paper(arena=str(file))).power_left)).round(6) == [3.0]
    assert not recwarn.list


def test_an_unknown_arena_or_a_broken_file_is_an_error_that_says_so(tmp_path):
    with pytest.raises(ValueError, match=f"{', '.join(ARENAS)}, or an MJCF file, not 'sea'"):
        compose(paper(arena="sea"))
    file = tmp_path / "broken.xml"
    file.write_text(PILLAR.replace('size="20 5"', 'size="twenty"'))
    with pytest.raises(ValueError, match=r"broken.xml: .*line 2"):
        compose(paper(arena=str(file)))


def test_robots_of_the_urban_preset_lose_each_other_behind_blocks_and_find_each_other_again():
    """Pairs that are linked, then not for 2 s at least, then linked again, for as long each."""
    swarm = Swarm(PRESETS["urban"](num_robots=20), [1])
    rule, linked = swarm.channel.reception, []
    for _ in range(500):
        position_m = swarm.move().position_m
        powers_mw = swarm.channel.mean_powers_mw(position_m[0], 0)
        linked.append(powers_mw >= rule.noise_mw * rule.threshold)
    num_found = 0
    for i, j in combinations(range(20), 2):
        runs = [
            (is_linked, len(list(run)))
            for is_linked, run in groupby(links[i, j] for links in linked)
        ]
        lasting = [is_linked for is_linked, length in runs if length >= 20]
        num_found += [True, False, True] in [lasting[k : k + 3] for k in range(len(lasting))]
    assert num_found > 5


def refusal(tmp_path, text, **fields):
    file = tmp_path / "mine.xml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"mine\.xml") as caught:
        compose(paper(arena=str(file), **fields))
    return str(caught.value)


def test_names_that_are_no_arena_are_refused_with_what_is_wrong(tmp_path):
    for name, said in (
        ("bloks", "not 'bloks'; did you mean blocks?"),
        ("nofile.xml", "arena nofile.xml: there is no such file"),
        (str(tmp_path), "is a directory; name an MJCF file in it"),
    ):
        with pytest.raises(ValueError, match=re.escape(said)):
            compose(paper(arena=name))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PILLAR.replace('"20 5"', '20 5"'), "line 2: not well-formed XML"),
        ("", "line 1: not well-formed XML"),
        (PILLAR.replace('group="1"', 'group="1" user="nan"'), "geom pillar has nan in user"),
        (PILLAR.replace('group="1"', ""), "has no obstacle, which is any geom of group 1"),
        ("<mujoco/>", 'give walls group="1"'),
        (
            PILLAR.replace('cylinder" size="20 5', 'plane" size="20 5 1'),
            "but a plane or a height field",
        ),
        (
            PILLAR.replace("0 0 5", "520.1 0 5"),
            "pillar stands outside the area of 1000 m by 1000 m",
        ),
        (PILLAR.replace("0 0 5", "0 0 6.6"), "pillar stands above the robots, which are 1 m"),
        (PILLAR.replace("0 0 5", "0 0 -4.6"), "pillar stands below the robots, which are 1 m"),
    ],
)
def test_a_file_that_can_be_no_arena_is_refused_with_what_is_wrong(tmp_path, text, said, capfd):
    message = refusal(tmp_path, text)
    assert said in message
    assert "\n" not in message
    assert capfd.readouterr().err == ""  # MuJoCo would warn of a nan, and log it


def test_obstacles_that_nothing_can_touch_are_named_if_others_can_be(tmp_path):
    """The pillar's radius is 20 m: at 519 m it stands 1 m within an area of 1 km."""
    far = '<geom name="far" type="cylinder" size="20 5" pos="-521 0 5" group="1"/></worldbody>'
    file = tmp_path / "two.xml"
    file.write_text(PILLAR.replace("0 0 5", "519 0 5").replace("</worldbody>", far))
    mission = paper("random-walk", arena=str(file))
    (note,) = notes_on(mission)
    assert note.endswith("geom far does nothing, as it stands outside the area of 1000 m by 1000 m")
    assert notes_on(replace(mission, boundary="none")) == []  # robots may get there
    assert notes_on(paper(arena="blocks")) == []


def compiled(body, *, head=""):
    return mujoco.MjModel.from_xml_string(f"<mujoco>{head}<worldbody>{body}</worldbody></mujoco>")


def losses_db(body, *, head=""):
    return (-10 * np.log10(obstacles_of(compiled(body, head=head)).power_left)).round(6).tolist()


def test_only_geoms_of_the_group_that_stand_still_count():
    found = obstacles_of(
        compiled(
            f"""
            <geom type="box" size="1 2 3" pos="4 5 6" group="{OBSTACLE_GROUP}"/>
            <geom type="box" size="1 2 3"/>
            <geom type="plane" size="9 9 1" group="{OBSTACLE_GROUP}"/>
            <body><freejoint/><geom type="sphere" size="1" group="{OBSTACLE_GROUP}"/></body>
            <body pos="7 0 0"><geom type="sphere" size="8" group="{OBSTACLE_GROUP}"/></body>
            """
        )
    )
    assert found.kind.tolist() == [BOX, SPHERE]
    assert found.centre_m.tolist() == [[4, 5, 6], [7, 0, 0]]
    assert found.size_m[0].tolist() == [1, 2, 3]
    assert found.reach_m[1] == 8


def test_losses_come_from_the_geom_or_its_material_or_are_usual():
    geom = f'<geom type="box" size="1 1 1" group="{OBSTACLE_GROUP}"'
    material = '<asset><material name="heavy wall"/><material name="paper"/></asset>'
    body = f'{geom} material="heavy wall"/>{geom} material="paper"/>{geom}/>'
    assert losses_db(body, head=material) == [6.9, DEFAULT_LOSS_DB, DEFAULT_LOSS_DB]
    both = f'{geom} user="3.5"/>{geom}/>'
    assert losses_db(both, head='<size nuser_geom="1"/>') == [3.5, DEFAULT_LOSS_DB]


@pytest.mark.parametrize("loss", ["-1", "inf"])
def test_losses_below_0_or_without_end_are_refused(loss):
    geom = f'<geom name="wall" type="box" size="1 1 1" group="{OBSTACLE_GROUP}" user="{loss}"/>'
    model = compiled(geom.replace("inf", "0"), head='<size nuser_geom="1"/>')
    model.geom_user[0, 0] = float(loss)
    with pytest.raises(ValueError, match=r"loss of geom wall must be 0 dB or more, not"):
        obstacles_of(model)


def test_a_mesh_is_the_box_around_it():
    mesh = '<asset><mesh name="m" vertex="0 0 0 2 0 0 0 4 0 0 0 6"/></asset>'
    body = f'<geom type="mesh" mesh="m" pos="10 0 0" group="{OBSTACLE_GROUP}"/>'
    model = compiled(body, head=mesh)
    found = obstacles_of(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    corners = model.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    off = (corners - found.centre_m[0]) @ found.rotation[0]
    assert found.kind.tolist() == [BOX]
    np.testing.assert_allclose(off.min(axis=0), -found.size_m[0], atol=1e-6)
    np.testing.assert_allclose(off.max(axis=0), found.size_m[0], atol=1e-6)


WALL = '<worldbody><geom type="box" size="9 9 9" group="1"/></worldbody>'
MESH = '<compiler {}="parts"/><asset><mesh name="m" file="stream.stl"/></asset>'
BOXES = '<mujoco><worldbody>{}<geom type="box" size="9 9 9" group="1"/></worldbody></mujoco>'


def copies(*counts):
    """A ball that is copied, by counts from the outside to the inside."""
    ball = '<geom size="1"/>'
    for count in reversed(counts):
        ball = f'<replicate count="{count}">{ball}</replicate>'
    return ball


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<geom type="box" size="1 9 9" pos="inf 0 5" group="1"/>', "has inf in pos"),
        ('<geom type="box" size="-infinity 9 9" group="1"/>', "has -infinity in size"),
        (copies("100000"), "10000 are allowed"),
        (copies(" 20000"), "10000 are allowed"),
        (copies("+2e4"), "10000 are allowed"),
        (copies(9999, 9999), "multiplied where one is within another, make 99980000 copies or"),
        (copies(100, 100, 100, 100), "10000 are allowed"),
        (copies(6000) + copies(6000), "make 11998 copies or more"),
        (
            '<replicate count="5000"><include file="parts/many.xml"/></replicate>',
            "make 14999 copies or more",
        ),
        ('<flexcomp name="f" type="grid" count="300 300 300"/>', "10000 are allowed"),
        ("<frame>" * 3000 + copies(20000) + "</frame>" * 3000, "10000 are allowed"),
        ('<include file="pipe"/>', "include pipe is a folder, a pipe or a device"),
        ('<include file="parts/nested.xml"/>', "include pipe is a folder, a pipe or a device"),
        ('<include file="parts/endless.xml"/>', "geom wall has inf in pos"),
        (MESH.format("meshdir"), "mesh stream.stl is a folder, a pipe or a device"),
        (MESH.format("assetdir"), "mesh stream.stl is a folder, a pipe or a device"),
    ],
)
def test_files_without_an_end_are_refused_at_once(tmp_path, inside, said):
    (tmp_path / "parts").mkdir()
    os.mkfifo(tmp_path / "pipe")
    os.mkfifo(tmp_path / "parts" / "stream.stl")
    (tmp_path / "parts" / "nested.xml").write_text(BOXES.format('<include file="pipe"/>'))
    endless = BOXES.format('<geom name="wall" size="1" pos="inf 0 5"/>')
    (tmp_path / "parts" / "endless.xml").write_text(endless)
    (tmp_path / "parts" / "many.xml").write_text(BOXES.format(copies(3)))
    path = tmp_path / "arena.xml"
    path.write_text(
        f"<mujoco>{inside}{WALL}</mujoco>" if "compiler" in inside else BOXES.format(inside)
    )
    with pytest.raises(ValueError, match=said):
        Swarm(paper("stationary", num_robots=3, arena=str(path)), [1])


def test_a_relative_arena_includes_files_that_include_others(tmp_path, monkeypatch):
    parts = tmp_path / "city" / "parts"
    parts.mkdir(parents=True)
    (parts.parent / "arena.xml").write_text('<mujoco><include file="parts/a.xml"/></mujoco>')
    (parts / "a.xml").write_text('<mujoco><include file="b.xml"/></mujoco>')
    (parts / "b.xml").write_text(f"<mujoco>{WALL}</mujoco>")
    monkeypatch.chdir(tmp_path)
    swarm = Swarm(paper("stationary", num_robots=3, arena="city/arena.xml"), [1])
    assert len(swarm._physics.obstacles.kind) == 1


SETTINGS = [
    '<option timestep="0.01" gravity="0 0 1"><flag contact="disable"/></option>',
    '<size memory="1M"/>',
    '<size njmax="50" nconmax="20"/>',
    '<statistic extent="3" center="1 2 3"/>',
    '<visual><map znear="0.1"/><headlight diffuse=".1 .1 .1"/></visual>',
]


@pytest.mark.parametrize("settings", SETTINGS)
def test_a_file_s_settings_do_not_count_and_nothing_is_said(tmp_path, recwarn, capfd, settings):
    """MuJoCo told of an "Attach conflict", twice, in up to seven lines."""
    path = tmp_path / "arena.xml"
    path.write_text(f"<mujoco>{settings}{WALL}</mujoco>")
    swarm = Swarm(paper("random-walk", num_robots=3, physics="contact", arena=str(path)), [1])
    swarm.start(make_policy("tdma", swarm.mission))
    path.write_text(f"<mujoco>{WALL}</mujoco>")
    plain = Swarm(swarm.mission, [1])
    plain.start(make_policy("tdma", swarm.mission))
    for _ in range(5):
        swarm.step()
        plain.step()
    np.testing.assert_array_equal(swarm.states.position_m, plain.states.position_m)
    assert not recwarn.list
    assert capfd.readouterr() == ("", "")


def test_files_that_include_each_other_are_refused(tmp_path):
    (tmp_path / "city").mkdir()
    path = tmp_path / "city" / "arena.xml"
    path.write_text(f'<mujoco>{WALL}<include file="../city/arena.xml"/></mujoco>')
    with pytest.raises(ValueError, match="already included"):
        Swarm(paper("stationary", num_robots=3, arena=str(path)), [1])


def test_a_scene_s_infinite_obstacles_are_refused():
    def endless(spec, _mission):
        box = mujoco.mjtGeom.mjGEOM_BOX
        spec.worldbody.add_geom(type=box, size=[1, 9, 9], pos=[np.inf, 0, 5], group=1)

    with pytest.raises(ValueError, match="infinite"):
        Swarm(paper("stationary", num_robots=3), [1], scene=endless)


@pytest.mark.parametrize(("arena", "loss_db"), [("blocks", 25.0), ("forest", 6.0), ("rooms", 3.4)])
def test_obstacles_of_an_arena_cost_what_their_material_does(arena, loss_db):
    mission = paper(arena=arena)
    losses_db = -10.0 * np.log10(obstacles(mission).power_left)
    np.testing.assert_allclose(losses_db, loss_db)
    (material,) = [each for each in MATERIALS.values() if each.loss_db == loss_db]
    shown = compose(mission).material(material.name)
    np.testing.assert_allclose(shown.rgba, material.rgba)


def test_every_obstacle_of_every_arena_has_a_material_whose_loss_is_known():
    """Without one it would cost 10 dB, in silence."""
    for arena in WITH_OBSTACLES:
        model = compose(paper(arena=arena)).compile()
        named = {model.mat(int(model.geom_matid[g])).name for g in obstacle_geoms(model)}
        assert named <= MATERIALS.keys()


def test_losses_in_the_docs_are_those_of_the_materials():
    page = (Path(__file__).parents[2] / "docs/channels.md").read_text("utf-8")
    sentence = page[page.index("the name of its material counts") : page.index("or else 10 dB")]
    said = re.findall(r"`([a-z ]+)`\s+([\d.]+)", sentence)
    assert len(said) == 4
    assert {name: float(loss_db) for name, loss_db in said} == {
        name: MATERIALS[name].loss_db for name, _ in said
    }
