"""The options that change a policy, for both commands that fly."""

import pytest

from swarm_mj.cli import parse
from swarm_mj.cli.policy_options import NAMES
from swarm_mj.policies.registry import POLICIES

both = pytest.mark.parametrize("command", ["fly", "evaluate"])


@both
def test_a_policy_flies_as_tuned_unless_it_is_told_otherwise(command):
    _, options = parse([command])
    assert (options.probability, options.is_deterministic) == (None, False)
    assert options.payload == "snapshots"
    typed = ["--probability", "0.25", "--deterministic", "--payload", "none"]
    _, options = parse([command, *typed, "--policy", "planner"])
    assert (options.probability, options.is_deterministic) == (0.25, True)
    assert options.payload == "none"


@both
@pytest.mark.parametrize(
    ("typed", "complaint"),
    [
        (["--probability", "-0.1"], "probability must be a number from 0 to 1, not -0.1"),
        (["--probability", "1.1"], "probability must be a number from 0 to 1, not 1.1"),
        (["--payload", "all"], "payload must be one of snapshots, none, not 'all'"),
    ],
)
def test_what_no_policy_can_do_is_refused(command, typed, complaint):
    with pytest.raises(ValueError, match=complaint):
        parse([command, *typed])


@both
def test_the_help_says_them_under_one_heading(capsys, command):
    with pytest.raises(SystemExit):
        parse([command, "--help"])
    _, _, below = " ".join(capsys.readouterr().out.split()).partition(" policies: ")
    assert "--probability X of a transmission" in below
    assert "(default: tuned for the regime)" in below
    assert "--deterministic learned policies take" in below


def test_the_names_are_those_that_can_be_typed():
    """The planner without its payload is an option of the planner's, not a word."""
    _, _, listed = NAMES.partition(": ")
    assert listed.split(", ") == [name for name in POLICIES if " " not in name]
    assert {"planner", "gnn", "mst"} <= set(listed.split(", "))
