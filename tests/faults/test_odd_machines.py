"""Terminals, folders and names that are not as they usually are."""

import io
import json
import os
import subprocess
import sys
from dataclasses import asdict

import pyarrow as pa
import pytest
import synthetic
from damage import RESULTS
from pyarrow import parquet

import swarm_mj
from swarm_mj.cli import main
from swarm_mj.evaluation.results import COLUMNS
from swarm_mj.replay.read import check_replay
from swarm_mj.system.writing import write_csv

ROBOTS = ("--robots", "4", "--windows", "3")
FLIGHT = ("fly", *ROBOTS, "--no-record")
EVALUATION = ("evaluate", *ROBOTS, "--policy", "tdma", "--episodes", "2")
BENCH = ("bench", "--help")
RECORD = ("--record", "a.rrd")
NOWHERE = "/proc/nowhere"  # nobody can make that
NOT_UTF8 = os.fsdecode(b"a\xff")


def python(*arguments, cwd, **environment):
    """A finished process, of a user with no settings but these."""
    bare = {"PATH": os.environ["PATH"], "PYTHONPATH": os.environ.get("PYTHONPATH", os.getcwd())}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd, env=bare | environment, capture_output=True, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def installation(tmp_path_factory):
    """The package where no cache can be written: a file stands where each folder would."""
    root = tmp_path_factory.mktemp("installed")
    package = os.path.dirname(swarm_mj.__file__)
    for folder, folders, files in os.walk(package):
        folders[:] = [name for name in folders if name != "__pycache__"]
        copy = root / "swarm_mj" / os.path.relpath(folder, package)
        copy.mkdir(parents=True)
        (copy / "__pycache__").touch()
        for name in files:
            (copy / name).symlink_to(os.path.join(folder, name))
    (root / "assets").symlink_to(os.path.join(package, os.pardir, "assets"))
    return root


@pytest.mark.slow
@pytest.mark.fault("odd machine: read-only, no home")
def test_a_read_only_installation_without_a_home_works(installation, tmp_path):
    """Fault 23: even `--version` was a traceback."""
    for arguments in (["--version"], ["scene", "--robots", "3"]):
        command = ("-m", "swarm_mj", *arguments)
        done = python(*command, cwd=tmp_path, PYTHONPATH=str(installation), HOME=NOWHERE)
        assert (done.returncode, done.stderr) == (0, b""), arguments
    assert [path.name for path in tmp_path.iterdir()] == ["scene.xml"]


@pytest.mark.slow
@pytest.mark.fault("odd machine: read-only, no home")
def test_figures_need_no_folder_of_their_own(tmp_path):
    """Fault 23, too: matplotlib complained in two lines."""
    asked = (
        "figures",
        RESULTS / "paper-random-walk.csv",
        "--out",
        "figures",
        "--figure",
        "fig5",
        "--format",
        "png",
    )
    done = python("-m", "swarm_mj", *map(str, asked), cwd=tmp_path, HOME=NOWHERE)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.fault("odd machine: terminals")
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-16", "utf-8"])
@pytest.mark.parametrize("command", [FLIGHT, (*EVALUATION, "--wide"), BENCH])
@pytest.mark.usefixtures("here")
def test_any_terminal_shows_what_it_can(monkeypatch, encoding, command):
    """Fault 26: `±` and `²` failed in ASCII when all was flown."""
    shown, told = (io.TextIOWrapper(io.BytesIO(), encoding=encoding) for _ in range(2))
    monkeypatch.setattr(sys, "stdout", shown)
    monkeypatch.setattr(sys, "stderr", told)
    assert main(list(command)) == 0
    told.flush()
    assert "error" not in told.buffer.getvalue().decode(encoding)
    shown.flush()
    text = shown.buffer.getvalue().decode(encoding)
    assert "mission" in text or "windows" in text
    assert ("²" in text) is (command is not BENCH and encoding != "ascii")


@pytest.mark.slow
@pytest.mark.fault("odd machine: terminals")
def test_closed_streams_get_no_file_s_number(tmp_path):
    """What libraries complain of would else stand in the replay."""
    code = f"import os; from swarm_mj.cli import main; main({['fly', *ROBOTS, *RECORD]})"
    check = "assert os.fstat(1).st_rdev == os.fstat(2).st_rdev == os.stat(os.devnull).st_rdev"
    line = f'exec {sys.executable} -c "{code}; {check}" <&- >&- 2>&-'
    done = subprocess.run(["sh", "-c", line], cwd=tmp_path, check=False)
    assert done.returncode == 0
    check_replay(tmp_path / "a.rrd")


@pytest.mark.fault("odd machine: names")
@pytest.mark.parametrize(
    "arguments",
    [
        (*FLIGHT[:-1], "--record", f"{NOT_UTF8}.rrd"),
        (*FLIGHT, "--json", f"{NOT_UTF8}.json"),
        (*FLIGHT, "--policy", f"{NOT_UTF8}/policy"),
        (*EVALUATION, "--csv", f"{NOT_UTF8}.csv"),
        (*EVALUATION, "--policy", "tdma", f"./{NOT_UTF8}"),
        ("train", "--out", NOT_UTF8, "--budget", "1"),
        ("train", "--out", "a", "--init", NOT_UTF8),
        ("figures", f"{NOT_UTF8}.csv", "--out", "figures"),
        ("figures", "a.csv", "--out", NOT_UTF8),
        ("scene", "--out", f"{NOT_UTF8}.xml"),
        ("replay", f"{NOT_UTF8}.rrd"),
    ],
)
def test_a_name_that_is_not_utf8_is_refused_before_the_work(here, capsys, arguments):
    """Fault 26: replays failed when all was flown, tables when all was evaluated."""
    assert main(list(arguments)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "udcff" in line
    assert "utf-8; rename it" in line
    assert not list(here.iterdir())


DRIVES = "a\nb\x1b[31mred\x9b2J\u2028c"  # a terminal that shows it raw


def in_one_dull_line(said):
    """Passes if what was said is one line that drives no terminal."""
    assert said.endswith("\n")
    assert said[:-1].isprintable(), ascii(said)


@pytest.mark.fault("odd machine: names")
@pytest.mark.parametrize(
    "arguments",
    [
        (DRIVES,),
        ("fly", DRIVES),
        (*FLIGHT, f"--{DRIVES}"),
        (*FLIGHT, "--task", DRIVES),
        (*FLIGHT, "--policy", DRIVES),
        (*FLIGHT, "--policy", f"{DRIVES}:Mine"),
        (*FLIGHT, "--channel", f"table:{DRIVES}"),
        (*FLIGHT, "--arena", f"{DRIVES}.xml"),
        (*FLIGHT[:-1], "--record", f"{DRIVES}.rrd"),
        (*EVALUATION, "--csv", f"{DRIVES}.csv"),
        ("train", "--out", DRIVES, "--budget", "1"),
        ("policies", DRIVES),
        ("replay", f"{DRIVES}.rrd"),
        ("study", "run", f"{DRIVES}.toml"),
        ("scene", "--out", f"{DRIVES}.xml"),
    ],
)
def test_no_name_drives_the_terminal(here, capsys, arguments):
    """Line breaks and escape sequences were printed as they are, or written into file names."""
    assert main(list(arguments)) == 2
    said = capsys.readouterr()
    assert not said.out
    in_one_dull_line(said.err)
    assert not list(here.iterdir())


QUOTED = json.dumps(DRIVES)
STUDIES = [
    f"{QUOTED} = 1",
    f"[study]\n{QUOTED} = 1",
    f"[study]\npolicies = [{QUOTED}]",
    f'[study]\npolicies = ["gnn"]\nfeatures = {QUOTED}',
    f"[study.components]\nchannel = {QUOTED}",
    f"[missions.{QUOTED}]\nnum_robots = 3",
    f"[mission]\narena = {QUOTED}",
    f"[mission]\nnum_robots = [3, {QUOTED}]",
    f"x = [[{{a = {QUOTED}}}]]",
]


@pytest.mark.fault("odd machine: names")
@pytest.mark.parametrize("text", STUDIES)
def test_no_name_in_a_study_drives_the_terminal(here, capsys, text):
    (here / "s.toml").write_text(text, encoding="utf-8")
    assert main(["study", "run", "s.toml"]) == 2
    said = capsys.readouterr().err
    in_one_dull_line(said)
    assert "has control characters; write it without them" in said


@pytest.mark.fault("odd machine: names")
def test_no_name_in_results_drives_the_terminal(here, capsys):
    """Neither in a table that `figures` draws, nor in missions that `study compare` prints."""
    rows = [asdict(each) for each in synthetic.everything()]
    rows[0]["policy"] = DRIVES
    write_csv(here / "r.csv", COLUMNS, rows)
    assert main(["figures", "r.csv", "--out", "out"]) == 2
    in_one_dull_line(capsys.readouterr().err)
    assert main([*EVALUATION, "--parquet", "m.parquet"]) == 0
    missions = parquet.read_table(here / "m.parquet")
    names = pa.array([DRIVES] * len(missions))
    place = missions.schema.get_field_index("policy")
    parquet.write_table(missions.set_column(place, "policy", names), here / "m.parquet")
    capsys.readouterr()
    assert main(["study", "compare", "m.parquet", "m.parquet"]) == 2
    in_one_dull_line(capsys.readouterr().err)


@pytest.mark.fault("odd machine: names")
def test_an_error_of_a_library_is_shown_in_one_dull_line(monkeypatch, capsys):
    def fails(_):
        raise ValueError(DRIVES)

    monkeypatch.setattr("swarm_mj.cli.fly.run", fails)
    assert main(list(FLIGHT)) == 2
    in_one_dull_line(capsys.readouterr().err)


@pytest.mark.fault("odd machine: names")
def test_a_deleted_folder_is_told_before_the_work(monkeypatch, tmp_path, capsys):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert main([*FLIGHT, "--json", str(tmp_path / "a.json")]) == 2
    assert "the current folder was deleted" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
