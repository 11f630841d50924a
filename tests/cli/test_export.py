"""`swarm-mj export`: files beside the replay or elsewhere, all of them or none."""

from pathlib import Path

import pytest
from file_limits import no_larger_files

from swarm_mj.cli import main
from swarm_mj.replay.export import formats

FLIGHT = ["fly", "--task", "random-walk", "--robots", "5", "--windows", "12", "--range-ratio"]
NAMES = {
    "mcap": ["a.mcap"],
    "ns2": ["a-schedule.csv", "a.tcl"],
    "csv": ["a-ages.csv", "a-packets.csv", "a-positions.csv"],
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The replay of a short walk."""
    path = tmp_path_factory.mktemp("replay") / "a.rrd"
    arguments = [*FLIGHT, "0.5", "--policy", "tdma", "--record", str(path)]
    assert main(arguments) == 0
    return path.read_bytes()


@pytest.fixture
def walk(here, recorded):
    """The replay in a folder of its own."""
    (here / "a.rrd").write_bytes(recorded)
    return here


def names(folder):
    return sorted(path.name for path in folder.iterdir() if path.name != "a.rrd")


@pytest.mark.parametrize("to", NAMES)
def test_files_stand_beside_the_replay_and_are_replaced_by_force_only(walk, capsys, to):
    assert main(["export", "a.rrd", "--to", to]) == 0
    said = capsys.readouterr().out
    assert names(walk) == NAMES[to]
    for name in NAMES[to]:
        assert f"Wrote {name}: {round(Path(name).stat().st_size / 1e3):,} kB\n" in said
    assert main(["export", "a.rrd", "--to", to]) == 2
    assert "exists; name another, or replace it with --force" in capsys.readouterr().err
    for name in NAMES[to]:
        Path(name).write_text("old")
    assert main(["export", "a.rrd", "--to", to, "--force"]) == 0
    assert all(Path(name).read_bytes() != b"old" for name in NAMES[to])


@pytest.mark.parametrize(
    ("to", "out", "written"),
    [
        ("mcap", "runs/b", ["b.mcap"]),
        ("mcap", "runs/b.mcap", ["b.mcap"]),
        ("ns2", "runs/b.tcl", ["b-schedule.csv", "b.tcl"]),
        ("csv", "runs/b.CSV", ["b-ages.csv", "b-packets.csv", "b-positions.csv"]),
        ("csv", "runs/seed.5", ["seed.5-ages.csv", "seed.5-packets.csv", "seed.5-positions.csv"]),
    ],
)
def test_a_name_may_be_typed_with_the_ending_of_a_file(walk, to, out, written):
    assert main(["export", "a.rrd", "--to", to, "--out", out]) == 0
    assert names(walk / "runs") == written


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("a.rrd", "the following arguments are required: --to"),
        ("a.rrd --to xls", "error: --to must be one of mcap, ns2, csv, not 'xls'"),
        ("a.rrd --to mcap --out b.csv", "mcap writes NAME.mcap, not b.csv; leave .csv out"),
        ("a.rrd --to csv --out .", "out must be how the names of files begin, not ."),
        ("b.rrd --to csv", "replay b.rrd cannot be found"),
        ("b.rrd --to mcap", "replay b.rrd cannot be found"),
        ("c.rrd --to csv", "c.rrd is no whole replay: damaged"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_line(walk, capsys, arguments, complaint):
    (walk / "c.rrd").write_bytes(b"RRF2")
    assert main(["export", *arguments.split()]) == 2
    said = capsys.readouterr().err
    assert complaint in said
    assert said.count("\n") == 1
    assert names(walk) == ["c.rrd"]


def test_without_its_packages_mcap_is_refused_before_the_work(walk, capsys, monkeypatch):
    monkeypatch.setattr("swarm_mj.system.packages.is_installed", lambda module: module == "rerun")
    monkeypatch.setattr("swarm_mj.replay.read.read_flown", lambda _: pytest.fail("read"))
    assert main(["export", "a.rrd", "--to", "mcap"]) == 1
    assert "pip install 'swarm_mj[mcap]'" in capsys.readouterr().err
    assert names(walk) == []


def test_on_a_full_disk_nothing_is_left(walk, capsys):
    with no_larger_files(1000):
        assert main(["export", "a.rrd", "--to", "csv"]) == 1
    assert "File too large" in capsys.readouterr().err
    assert names(walk) == []


def test_an_interrupt_in_the_last_file_leaves_none(walk, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    made = formats.FORMATS["csv"] | {"-ages.csv": interrupted}
    monkeypatch.setitem(formats.FORMATS, "csv", made)
    assert main(["export", "a.rrd", "--to", "csv"]) == 130
    assert names(walk) == []
