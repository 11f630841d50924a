"""Exit codes are what scripts rely on, so they never change."""

from swarm_mj.system import exit_codes


def test_the_codes_are_those_that_the_help_and_the_documentation_name():
    assert exit_codes.DONE == 0
    assert exit_codes.FAILED == 1
    assert exit_codes.BAD_INPUT == 2
    assert exit_codes.INTERRUPTED == 128 + 2  # as shells have it of SIGINT, which is number 2
