"""Arenas and channels that cannot be: one clear line each, exit code 2, and nothing is written."""

import pytest

GEOM = '<geom name="pillar" type="box" size="20 20 5" pos="0 0 5" group="1"/>'
SMALL = ("fly", "--robots", 6, "--windows", 3)


def mjcf(geom):
    return f"<mujoco>\n<worldbody>\n{geom}\n</worldbody>\n</mujoco>\n"


FILES = {
    "full": (
        mjcf(GEOM.replace("20 20 5", "2000 2000 5")),
        "6 of 6 robots found no free space in 1000 draws over an area of 387 m by 387 m; choose an "
        "arena that leaves more room, or fewer robots",
    ),
    "empty": (
        mjcf(GEOM.replace('group="1"', "")),
        "arena world.xml has no obstacle: none of its geoms is of group 1; give walls "
        'group="1", or choose arena open',
    ),
    "unclosed": (mjcf(GEOM.replace("/>", ">")), "not well-formed XML"),
    "no number": (mjcf(GEOM.replace("20 20 5", "20 wide 5")), "line 3"),
    "no size": (mjcf(GEOM.replace("20 20 5", "20 0 5")), "size 1 must be positive in geom"),
    "no mesh": (mjcf('<geom type="mesh" mesh="hall"/>'), "arena world.xml: Error: "),
    "gain": (
        mjcf(GEOM.replace("group", 'user="-3" group')),
        "arena world.xml: the penetration loss of geom pillar must be 0 dB or more, not -3",
    ),
    "moving": (
        mjcf(f'<body name="cart"><joint type="slide"/>{GEOM}</body>'),
        "arena world.xml: cart has a joint, but obstacles stand still",
    ),
    "text": ("a wall here, please", "not well-formed XML"),
}
OPTIONS = {
    "--rician-k -1": "Rician K must be a number from 0 to 10000 [1], not -1",
    "--arena sea": "open, blocks, forest, rooms, or an MJCF file, not 'sea'",
    "--arena blocks --physics exact": "choose physics contact, or arena open",
    "--preset urban --physics exact": "arena blocks has obstacles; choose physics contact, or",
    "--collide --physics exact": "exact physics knows no collisions, so robots cannot",
}


@pytest.mark.parametrize("name", FILES)
def test_a_bad_arena_is_one_clear_line(refusal, tmp_path, name):
    text, complaint = FILES[name]
    (tmp_path / "world.xml").write_text(text)
    line = refusal(*SMALL, "--arena", "world.xml")
    assert complaint in line
    is_mujocos = name in ("no number", "no size", "no mesh")
    assert not is_mujocos or "line " in line.lower()


def test_a_hall_that_would_fill_a_smaller_teams_area_is_flown(succeed, tmp_path):
    """6 robots have 387 m by 387 m, and the 3 that compile ahead would have 274 m."""
    (tmp_path / "world.xml").write_text(mjcf(GEOM.replace("20 20 5", "150 150 5")))
    flown = ("--range-ratio", 0.5, "--no-record", "--arena", "world.xml", "--policy", "tdma")
    succeed(*SMALL, *flown)


@pytest.mark.parametrize("options", OPTIONS)
def test_a_world_that_cannot_be_is_one_clear_line(refusal, options):
    assert OPTIONS[options] in refusal(*SMALL, *options.split())
