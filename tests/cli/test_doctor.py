"""The doctor's words and exit code, by what was found."""

import json

import pytest

from swarm_mj.cli import doctor, main
from swarm_mj.cli.health.finding import Finding

SOUND = Finding("speed", "cores", "ok", "2 may be used")
ABSENT = Finding("packages", "av", "absent", "not installed; for videos", "pip install 'av>=14'")
BROKEN = Finding("packages", "numba", "broken", "0.1, which is not >=0.68", "pip install numba")


@pytest.fixture
def find(monkeypatch):
    """Has the doctor find this, and nothing else."""

    def chosen(*findings):
        for name in ("about", "packages", "tried"):
            monkeypatch.setattr(doctor, name, tuple)
        monkeypatch.setattr(doctor, "machine", lambda: findings)

    return chosen


@pytest.mark.parametrize(
    ("findings", "code"), [([SOUND], 0), ([SOUND, ABSENT], 0), ([SOUND, ABSENT, BROKEN], 1)]
)
def test_only_what_is_broken_fails(find, capsys, findings, code):
    find(*findings)
    assert main(["doctor", "--json"]) == code
    said = json.loads(capsys.readouterr().out)
    assert said == {"works": code == 0, "findings": [each._asdict() for each in findings]}


def test_the_table_says_what_to_do(find, capsys):
    find(SOUND, ABSENT, BROKEN)
    assert main(["doctor"]) == 1
    shown = capsys.readouterr().out
    assert "  av: pip install 'av>=14'\n  numba: pip install numba\n" in shown
    assert shown.endswith("until what is BROKEN is mended.\n")
    find(SOUND)
    assert main(["doctor"]) == 0
    assert capsys.readouterr().out.endswith(
        "│\n└─────────┴────┴───────────────┘\nswarm_mj works here.\n"
    )


def test_this_machine_flies(swarm_mj):
    done = swarm_mj("doctor", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    states = {each["name"]: each["state"] for each in json.loads(done.stdout)["findings"]}
    for name in ("version", "numba", "three robots fly", "torch", "cores", "disk free here"):
        assert states[name] == "ok"
    assert {"MUJOCO_GL=egl", "MUJOCO_GL=osmesa", "MUJOCO_GL=glfw", "Vulkan"} <= set(states)
