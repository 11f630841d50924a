"""What the doctor finds, says, and ends with."""

import json
import tomllib
from email.message import Message
from importlib import metadata
from pathlib import Path

import pytest

from swarm_mj.cli import doctor, main
from swarm_mj.cli.doctor import Finding, packages, tried
from swarm_mj.radio import reception

SOUND = Finding("speed", "cores", "ok", "2 may be used")
ABSENT = Finding("packages", "av", "absent", "not installed; for videos", "pip install 'av>=14'")
BROKEN = Finding("packages", "numba", "broken", "0.1, which is not >=0.68", "pip install numba")


@pytest.fixture
def diagnosis(monkeypatch, capsys):
    """Runs the doctor, who finds this and nothing else; what it ends with, and prints."""

    def diagnosed(*options, found):
        for name in ("packages", "tried"):
            monkeypatch.setattr(doctor, name, tuple)
        monkeypatch.setattr(doctor, "machine", lambda: found)
        return main(["doctor", *options]), capsys.readouterr().out

    return diagnosed


@pytest.mark.parametrize(
    ("findings", "code"), [([SOUND], 0), ([SOUND, ABSENT], 0), ([SOUND, ABSENT, BROKEN], 1)]
)
def test_only_what_is_broken_fails_and_the_table_says_what_to_do(diagnosis, findings, code):
    exit_code, printed = diagnosis("--json", found=findings)
    assert exit_code == code
    document = {"works": code == 0, "findings": [each._asdict() for each in findings]}
    assert json.loads(printed) == document
    exit_code, printed = diagnosis(found=findings)
    assert exit_code == code
    for each in findings:
        assert (f"  {each.name}: {each.mend}\n" in printed) == (each.state != "ok")
    verdict = "does not work here until what is BROKEN is mended" if code else "works here"
    assert printed.endswith(f"\nswarm_mj {verdict}.\n")


@pytest.mark.slow
def test_this_machine_flies(succeed):
    done = succeed("doctor", "--json")
    states = {each["name"]: each["state"] for each in json.loads(done.stdout)["findings"]}
    for name in ("version", "numba", "three robots fly", "torch", "cores", "disk free here"):
        assert states[name] == "ok"
    assert {"MUJOCO_GL=egl", "MUJOCO_GL=osmesa", "MUJOCO_GL=glfw"} <= set(states)


INSTALLED = {"numba": "0.68.1", "mujoco": "3.2", "torch": "2.7", "pettingzoo": "1.27"}
ASKED = [
    *("numba>=0.68", "mujoco>=3.17,<4", "numpy>=2.2", "torch>=2.7", "av>=14"),
    'pettingzoo>=1.25; extra == "pettingzoo"',
    'ruff>=0.17; extra == "dev"',
    'twine[keys]>=6; extra == "dev"',
    'swarm_mj[pettingzoo]; extra == "dev"',
]
FOUND = {  # what is found of an installation that asks for much and has little
    "numba": ("ok", "0.68.1", ""),
    "mujoco": (
        *("broken", "mujoco 3.2 is not <4,>=3.17; flying needs it"),
        "pip install 'mujoco<4,>=3.17'",
    ),
    "numpy": ("broken", "numpy is not installed; flying needs it", "pip install 'numpy>=2.2'"),
    "torch": ("ok", "2.7", ""),
    "av": ("absent", "av is not installed", "pip install 'av>=14'"),
    "extra pettingzoo": ("ok", "installed", ""),
    "extra dev": (
        *("absent", "ruff is not installed, twine is not installed"),
        "pip install 'ruff>=0.17' 'twine[keys]>=6'",
    ),
}


def test_each_is_as_it_is_installed(monkeypatch):
    def version(name):
        if name not in INSTALLED:
            raise metadata.PackageNotFoundError(name)
        return INSTALLED[name]

    extras = Message()
    for extra in ("pettingzoo", "dev"):
        extras["Provides-Extra"] = extra
    monkeypatch.setattr(doctor, "version", lambda: "0.1")
    monkeypatch.setattr(doctor.metadata, "version", version)
    monkeypatch.setattr(doctor.metadata, "requires", lambda _: ASKED)
    monkeypatch.setattr(doctor.metadata, "metadata", lambda _: extras)
    found = {each.name: each for each in packages() if each.group == "packages"}
    assert {name: tuple(each[2:]) for name, each in found.items()} == FOUND


def test_it_says_which_version_this_is():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    assert next(packages()).found.startswith(project["version"])


def of_machine(name):
    return next(each for each in doctor.machine() if each.name == name)


def test_compiled_code_needs_a_place_that_can_be_written(monkeypatch, tmp_path):
    class Kernel:
        class stats:  # noqa: N801 - numba's name
            cache_path = str(tmp_path)

    monkeypatch.setattr(reception, "sinr", Kernel)
    assert of_machine("compiled code").found == f"kept in {tmp_path}"
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").touch()
    Kernel.stats.cache_path = str(tmp_path / "file" / "folder")
    assert "cannot be written" in of_machine("compiled code").found
    Kernel.stats.cache_path = None
    assert of_machine("compiled code").state == "absent"
    assert "NUMBA_CACHE_DIR" in of_machine("compiled code").mend


@pytest.mark.parametrize(
    ("works", "said", "flight", "rendering"),
    [
        (True, "hello", ("ok", "works", ""), ("ok", "works", "")),
        (
            *(False, "no driver"),
            ("broken", "no driver", "see what `swarm-mj fly` says"),
            ("absent", "no driver", "Debian and Ubuntu: apt-get install libosmesa6"),
        ),
    ],
)
def test_what_came_of_trials(monkeypatch, works, said, flight, rendering):
    monkeypatch.setattr(doctor, "attempt", lambda *_: (works, said))
    found = {each.name: each[2:] for each in tried()}
    assert (found["three robots fly"], found["MUJOCO_GL=osmesa"]) == (flight, rendering)


def test_long_complaints_are_cut_between_words(monkeypatch):
    monkeypatch.setattr(doctor, "attempt", lambda *_: (False, "a word " * 99))
    assert next(tried()).found == "a word " * 56 + "a ..."


@pytest.mark.parametrize("name", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_a_display_is_one_of_two(monkeypatch, name):
    monkeypatch.setattr("sys.platform", "linux")
    for each in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(each, raising=False)
    without = {each.name: each for each in doctor.machine()}["display"]
    assert without.state == "absent"
    assert "--web" in without.mend
    monkeypatch.setenv(name, ":1")
    assert {each.name: each.state for each in doctor.machine()}["display"] == "ok"
