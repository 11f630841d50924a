"""The options' mission is the library's, and their defaults are its defaults."""

from swarm_mj.cli import make_parser
from swarm_mj.cli.options import mission_of
from swarm_mj.mission import Mission, paper, reference


def options(*arguments):
    return make_parser().parse_args(["fly", *arguments])


def test_the_default_mission_is_the_bare_one():
    assert mission_of(options()) == Mission()


def test_every_option_reaches_its_field():
    given = options(
        "--task", "random-walk", "--robots", "7", "--velocity-ratio", "0.5", "--range-ratio",
        "0.3", "--windows", "9", "--physics", "contact", "--boundary", "none",
        "--switched-off", "0.2",
    )  # fmt: skip
    assert mission_of(given) == paper(
        "random-walk", num_robots=7, velocity_ratio=0.5, range_ratio=0.3, num_windows=9,
        physics="contact", boundary="none", switched_off=0.2,
    )  # fmt: skip
    assert mission_of(options("--preset", "reference")) == reference(boundary="reflect")
