"""A finding is what `swarm-mj doctor --json` says of one thing."""

from swarm_mj.cli.health.finding import Finding


def test_what_is_well_needs_no_mending():
    found = Finding("room", "disk", "ok", "9 GB")
    assert found._asdict() == {
        "group": "room",
        "name": "disk",
        "state": "ok",
        "found": "9 GB",
        "mend": "",
    }
