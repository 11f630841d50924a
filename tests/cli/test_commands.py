"""The command line without a command."""


def test_no_command_and_version(swarm_mj):
    assert swarm_mj().returncode == 2
    assert swarm_mj("--version").stdout.startswith("swarm-mj ")
