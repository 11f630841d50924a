"""The options' missions and policies are the library's, and so are their defaults."""

import re
import shlex
from pathlib import Path
from typing import get_args

import pytest

import swarm_mj
from swarm_mj.api.fly import mission_of
from swarm_mj.cli import main, parse
from swarm_mj.cli.mission_options import NAMES, SPECS, mission_flags
from swarm_mj.cli.options import flags_of
from swarm_mj.evaluation.study import Study
from swarm_mj.learning.settings import Training
from swarm_mj.mission import PRESETS, WORLDS, Mission, paper, reference
from swarm_mj.mission.team import Task
from swarm_mj.physics.arenas import ARENAS
from swarm_mj.policies.registry import POLICIES
from swarm_mj.system.fields import GONE_IN, former_names, meaning_of

ROOT = Path(__file__).parents[2]


def mission(*arguments):
    return parse(["fly", *map(str, arguments)])[1].mission


def missions(*arguments):
    return parse(["evaluate", *map(str, arguments)])[1].missions


@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
@pytest.mark.parametrize(("preset", "make"), [("paper", paper), ("reference", reference)])
def test_the_default_is_the_presets_own_mission_for_every_command(preset, make, task):
    options = ["--task", task, "--preset", preset]
    assert mission(*options) == make(task)
    assert missions(*options) == (make(task),)
    assert parse(["scene", *options])[1].mission == make(task)


@pytest.mark.parametrize("preset", WORLDS)
def test_robots_of_a_world_walk_unless_told_otherwise(preset):
    assert mission("--preset", preset) == PRESETS[preset]("random-walk")
    assert missions("--preset", preset) == (PRESETS[preset]("random-walk"),)
    assert mission("--preset", preset, "--task", "flocking") == PRESETS[preset]("flocking")
    assert mission_of(swarm_mj.fly, None, {"preset": preset}) == PRESETS[preset]("random-walk")


MANY = "--task random-walk --robots 7 --velocity-ratio 0.5 --range-ratio 0.3 --windows 9 "
MANY += "--physics contact --boundary none --failure-fraction 0.2"
WALK = paper(
    "random-walk", num_robots=7, velocity_ratio=0.5, range_ratio=0.3, num_windows=9,
    physics="contact", boundary="none", failure_fraction=0.2,
)  # fmt: skip


@pytest.mark.parametrize(
    ("typed", "wanted"),
    [
        ("", paper("flocking", boundary="none")),  # flocks have none unless they are given one
        ("--task stationary", paper("stationary", boundary="reflect")),
        ("--boundary reflect", paper("flocking", boundary="reflect")),
        ("--bit-rate 250000", paper("flocking", bit_rate=250e3)),
        ("--bit-rate 250k", paper("flocking", bit_rate=250e3)),
        ("--bit-rate 6M", paper("flocking", bit_rate=6e6)),
        ("--bit-rate 1.5g", paper("flocking", bit_rate=1.5e9)),
        (MANY, WALK),
    ],
)
def test_options_reach_their_fields_and_what_is_shown_can_be_typed(typed, wanted):
    assert mission(*typed.split()) == wanted
    assert mission(*mission_flags(wanted).split()) == wanted


def test_sweeps_multiply_and_values_follow_one_flag_or_several():
    regimes = missions(
        *("--task", "stationary", "random-walk", "--robots", 10, "--robots", 20, 10),
        *("--preset", "reference", "--velocity-ratio", 0.3, "--range-ratio", 0.25, 0.5),
    )
    assert regimes == tuple(
        reference(task, num_robots=n, velocity_ratio=0.3, range_ratio=ratio)
        for task in ("stationary", "random-walk")
        for n in (10, 20)
        for ratio in (0.25, 0.5)
    )


@pytest.mark.parametrize(
    ("typed", "field", "values"),
    [
        ("--bit-rate 250k none", "bit_rate", [250e3, None]),
        ("--failure-fraction 0 0.2", "failure_fraction", [0.0, 0.2]),
        (
            "--prior-knowledge nothing start,map --prior-knowledge map,start map",
            "prior_knowledge",
            ["nothing", "map,start", "map"],  # which has one order
        ),
    ],
)
def test_every_field_is_swept(typed, field, values):
    assert missions(*typed.split()) == tuple(paper("flocking", **{field: x}) for x in values)


@pytest.mark.parametrize(
    ("former", "present"),
    [
        ("--known map,start", "--prior-knowledge map,start"),
        ("--switched-off 0.2", "--failure-fraction 0.2"),
        ("--strong-share 0.5", "--high-power-fraction 0.5"),
        ("--strong-share 0.5 --strong-db 3", "--high-power-fraction 0.5 --high-power-db 3"),
    ],
)
def test_former_options_still_count(former, present):
    assert missions(*former.split()) == missions(*present.split()) != missions()


def test_former_names_are_listed_with_the_date_until_when_they_work():
    former = former_names(Mission, Study, Training)
    options = (ROOT / "docs/options.md").read_text().split("## Former names")[1].split("\n## ")[0]
    rows = re.findall(r"\| `(\w+)` \| `(\w+)` \|$", options, re.MULTILINE)
    assert dict(rows) == former
    for page in (options, (ROOT / "CHANGELOG.md").read_text()):
        assert GONE_IN in " ".join(page.split())
        assert all(f"`{name}`" in page or f"`--{name}" in page for name in former)


def test_the_help_shows_every_field_that_has_help(capsys):
    assert main(["fly", "--help-all"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for spec in SPECS:
        assert f"{flags_of(spec)[0]} " in shown
        assert meaning_of(spec).help in shown
    assert f"what stands in the area: {', '.join(ARENAS)}, or an MJCF file" in shown
    assert "reflect, none (default: none for flocks in open areas, else reflect)" in shown


WITH_OTHER_DEFAULTS = [  # of the boundary or the physics, and missions that have neither
    {"arena": "forest"},
    {"arena": "forest", "boundary": "none"},
    {"arena": "open"},
    {"arena": "open", "boundary": "reflect"},
    {"arena": "open", "physics": "contact"},
    {"arena": "open", "robot": "rover"},
    {"arena": "blocks", "robot": "quadrotor:3,rover:2", "num_robots": 5, "boundary": "none"},
]


@pytest.mark.parametrize(
    "wanted",
    [
        paper("flocking", boundary="reflect", range_ratio=1 / 3, num_windows=7),
        reference("random-walk", physics="contact", failure_fraction=0.1),
        PRESETS["urban"](),
        PRESETS["urban"](collide=True),
        paper("random-walk", collide=True),
        PRESETS["urban"]("stationary", arena="open", num_robots=9),
        PRESETS["open-field"]("flocking", path_loss="free-space", fading="none"),
        paper("stationary", fading="rayleigh", prior_knowledge="statistics,start"),
        paper("stationary", arena="my 'red' hall.xml"),
    ],
)
def test_the_flags_of_a_mission_make_it_again(wanted):
    """As a shell reads them."""
    assert mission(*shlex.split(mission_flags(wanted))) == wanted


@pytest.mark.parametrize("given", WITH_OTHER_DEFAULTS)
@pytest.mark.parametrize("preset", PRESETS)
def test_the_flags_make_a_boundary_and_physics_again(preset, given):
    for task in get_args(Task):
        wanted = PRESETS[preset](task, **given)
        assert mission(*shlex.split(mission_flags(wanted))) == wanted


def test_the_flags_of_several_missions_make_them_all_again():
    typed = "--task stationary flocking --robots 9 --range-ratio 1 0.5 --fading none rayleigh"
    wanted = missions(*typed.split())
    assert len(wanted) == 8
    assert mission_flags(*wanted) == typed


def test_flags_leave_out_what_is_as_usual():
    assert mission_flags(paper("stationary", num_robots=9)) == "--task stationary --robots 9"


@pytest.mark.parametrize(
    ("wanted", "flags"),
    [
        (paper("flocking", arena="forest"), "--arena forest"),
        (paper("flocking", arena="forest", boundary="none"), "--arena forest --boundary none"),
        (paper("flocking", robot="rover"), "--robot rover"),
        (paper("flocking", collide=True), "--collide"),
        (PRESETS["urban"]("flocking", boundary="none"), "--boundary none"),
        (PRESETS["urban"]("flocking", arena="open"), "--arena open"),
    ],
)
def test_flags_leave_out_a_boundary_and_physics_that_go_with_the_others(wanted, flags):
    preset = "" if wanted.preset == "paper" else f"--preset {wanted.preset} "
    assert mission_flags(wanted) == f"{preset}--task flocking {flags}"


SWITCHES = {
    "--loss-exponent 3": "--path-loss log-distance",
    "--reference-m 2": "--path-loss log-distance",
    "--antenna-height-m 2": "--path-loss two-ray",
    "--shadowing-distance-m 5": "--shadowing-db above 0",
    "--rician-k 3": "--fading rician",
    "--burst-end 0.1": "--burst-begin above 0",
    "--high-power-db 3": "--high-power-fraction above 0",
    "--map-offset-m 3": "--prior-knowledge map",
    "--position-noise-s 3": "--position-noise-m above 0",
    "--wind-mps 5": "--robot other than point",
    "--height-range-m 5": "--robot other than point or rover",
    "--height-m 5": "--robot other than point or rover",
    "--height-m 5 --robot rover": "--robot other than point or rover",
    "--height-m 5 --robot rover:20,rover:20": "--robot other than point or rover",
}


@pytest.mark.parametrize("given", SWITCHES)
@pytest.mark.parametrize("command", ["fly", "evaluate", "train --minutes 1 --out run"])
def test_an_option_that_would_change_nothing_is_refused(command, given, capsys, here):
    assert main([*command.split(), *given.split()]) == 2
    flag, needed = given.split()[0], SWITCHES[given]  # what else is given leaves it off
    complaint = f"{flag} counts only with {needed}; give that too, or leave {flag} out"
    assert complaint in " ".join(capsys.readouterr().err.split())
    assert list(here.iterdir()) == []


def test_a_fraction_that_rounds_to_no_robot_makes_no_other_missions():
    swept = missions("--robots", 10, 100, "--high-power-fraction", 0, 0.01)
    assert [(each.num_robots, each.num_high_power) for each in swept] == [
        (10, 0),
        (100, 0),
        (100, 1),
    ]


def test_heights_count_where_some_robots_fly():
    some = mission("--robot", "rover:2,quadrotor:1", "--robots", 3, "--height-m", 5)
    assert some.height_m == 5.0
    rovers, quadrotors = missions("--robot", "rover", "quadrotor", "--height-m", 5)
    assert "--height-m 5" in mission_flags(quadrotors)
    assert "--height-m" not in mission_flags(rovers)  # which alone would be refused


def test_an_option_may_count_in_some_of_the_missions_only():
    both = missions("--fading", "none", "rician", "--rician-k", 3)
    assert [each.fading for each in both] == ["none", "rician"]
    assert mission("--preset", "urban", "--rician-k", 3).rician_k == 3.0


@pytest.mark.parametrize("command", ["fly", "evaluate"])
def test_a_policy_flies_as_tuned_unless_it_is_told_otherwise(command):
    typed = ["--probability", "0.25", "--deterministic", "--payload", "none", "--policy", "planner"]
    for arguments, values in (([], (None, False, "snapshots")), (typed, (0.25, True, "none"))):
        _, options = parse([command, *arguments])
        assert (options.probability, options.is_deterministic, options.payload) == values


def test_the_names_are_those_that_can_be_typed():
    """The planner without its payload is an option of the planner's, not a word."""
    _, _, listed = NAMES.partition(": ")
    assert listed.split(", ") == [name for name in POLICIES if " " not in name]
    assert {"planner", "gnn", "mst"} <= set(listed.split(", "))
