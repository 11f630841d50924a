"""Files that others hand us, damaged or crafted: one line says so, and the exit code is 2."""

import csv
import os
import shutil
import zipfile
from dataclasses import asdict

import numpy as np
import pytest
import synthetic
from damage import ROOT, complaint, damaged, program, told_or_read
from tiny_policies import save_tiny

from swarm_mj.cli import main, script
from swarm_mj.evaluation.results import COLUMNS, read_results, write_csv
from swarm_mj.policies.stored import read_policy
from swarm_mj.policies.tuning import TABLE, read_table


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "a.rrd"
    mission = ["--robots", "5", "--windows", "5"]
    assert main(["fly", "--policy", "tdma", *mission, "--record", str(path)]) == 0
    return path


@pytest.mark.fault("damaged files are told")
def test_damaged_replays_are_told_by_all_readers(replay, tmp_path, capsys, record_property):
    """Fault 11: a flip in what a replay holds was shown as if it had been flown, or crashed."""
    picture = program("tools", "picture")
    path, num_tries = tmp_path / "a.rrd", 0
    for content in damaged(replay.read_bytes()):
        path.write_bytes(content)
        num_tries += 1
        assert "is no whole replay: damaged" in complaint(capsys, main(["replay", str(path)]))
        with pytest.raises(ValueError, match="is no whole replay: damaged"):
            picture.take_picture(path, None, tmp_path / "a.png", "1600x900", 0)
    record_property("tries", num_tries)


@pytest.mark.fault("damaged files are told")
@pytest.mark.parametrize("what", ["results", "table", "policy", "curve"])
def test_damaged_files_are_told_or_sound(what, tmp_path, record_property):
    """Faults 15, 16: what can be read is within its ranges, and all else is told in a line."""
    path, read = READERS[what](tmp_path)
    num_tries = 0
    for content in damaged(path.read_bytes()):
        path.write_bytes(content)
        num_tries += 1
        told_or_read(read)
    record_property("tries", num_tries)


def _results(folder):
    write_csv(folder / "r.csv", synthetic.everything())
    return folder / "r.csv", lambda: read_results(folder / "r.csv")


def _table(folder):
    (folder / "t.csv").write_text("\n".join(TABLE.read_text().splitlines()[:5]))
    return folder / "t.csv", lambda: read_table(folder / "t.csv")


def _policy(folder):
    path = folder / "policy.safetensors"
    save_tiny(path)
    return path, lambda: read_policy(path)


def _curve(folder):
    curve = ROOT / "training" / "results" / "learning" / "rest-curve.csv"
    shutil.copy(curve, folder / "curve.csv")
    learning_figure = program("training", "learning_figure")
    return folder / "curve.csv", lambda: learning_figure.read_curve(folder / "curve.csv")


READERS = {
    "results": _results,
    "table": _table,
    "policy": _policy,
    "curve": _curve,
}


def with_cells(path, **cells):
    """Results of which the first has other cells."""
    rows = [asdict(each) for each in synthetic.everything()]
    rows[0] |= cells
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    return str(path)


CELLS = [
    {"range_ratio": 0},
    {"range_ratio": -1},
    {"range_ratio": "1e-400"},
    {"num_robots": 0},
    {"num_robots": 10**30},
    {"num_windows": "12x"},
    {"task": "swim"},
    {"preset": "mine"},
    {"aoi_mean": "1e308"},
    {"aoi_sem": "-1"},
    {"seed": "1" * 5000},
    {"policy": "x" * 10**6},
    {"boundary": "torus"},
    {"config": "[" * 9000},
    {"config": '{"receptive_field": 1e999}'},
]


@pytest.mark.fault("crafted files are refused")
def test_crafted_results_are_refused(tmp_path, capsys, record_property):
    """Fault 15: a range ratio of 0, an unknown task."""
    tables = program("tools", "results_table")
    for cells in CELLS:
        path = with_cells(tmp_path / "r.csv", **cells)
        complaint(capsys, main(["figures", path, "--out", str(tmp_path / "out")]))
        if "config" not in cells:
            complaint(capsys, tables.main([path]))
        assert not (tmp_path / "out").exists()
    record_property("tries", len(CELLS))


@pytest.mark.fault("crafted files are refused")
def test_a_policy_s_name_is_no_formula(tmp_path):
    r"""Fault 15: `$\\frac{$` is drawn as it is."""
    path = with_cells(tmp_path / "r.csv", policy=r"$\frac{$", commit="$^$")
    out = str(tmp_path / "out")
    assert main(["figures", path, "--out", out, "--figure", "fig4", "--format", "svg"]) == 0


@pytest.mark.fault("crafted files are refused")
@pytest.mark.parametrize("kind", ["device", "pipe", "folder", "loop"])
def test_what_is_no_file_is_refused_by_all_readers(tmp_path, capsys, record_property, kind):
    """Faults 8, 14, 22: a pipe was waited for, /dev/zero read until the memory was full."""
    path = tmp_path / "x"
    make = {
        "device": lambda: path.symlink_to("/dev/zero"),
        "pipe": lambda: os.mkfifo(path),
        "folder": path.mkdir,
        "loop": lambda: path.symlink_to(path),
    }
    make[kind]()
    name, out = str(path), str(tmp_path / "out")
    tune, weights = program("tools", "tune"), program("tools", "reference_policy")
    codes = [
        lambda: main(["replay", name]),
        lambda: main(["figures", name, "--out", out]),
        lambda: main(["fly", "--no-record", "--policy", name]),
        lambda: script(weights.Options, weights.run, [name]),
        lambda: program("tools", "results_table").main([name]),
        lambda: script(tune.Options, tune.run, ["--policy", "mst", "--out", name]),
    ]
    for code in codes:
        complaint(capsys, code())
    record_property("tries", len(codes))


@pytest.mark.fault("crafted files are refused")
def test_weights_of_others_are_arrays_and_no_bombs(tmp_path, capsys, record_property):
    """Fault 16: empty and damaged zips gave tracebacks."""
    weights = program("tools", "reference_policy")
    path, num_tries = tmp_path / "w.npz", 0
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr("policy.npy", bytes(10**8))
    np.save(tmp_path / "one.npy", np.zeros(3))
    np.savez(path, a=np.zeros(50))
    crafted = [(tmp_path / name).read_bytes() for name in ("bomb.npz", "one.npy")]
    for content in [b"", b"PK\x05\x06" + bytes(18), *crafted, *damaged(path.read_bytes())]:
        path.write_bytes(content)
        num_tries += 1
        assert told_or_read(lambda: weights.network_of(path)) is None
    complaint(capsys, script(weights.Options, weights.run, [str(path)]))
    record_property("tries", num_tries)


@pytest.mark.fault("crafted files are refused")
@pytest.mark.parametrize(
    "command",
    [
        ["train", "--out", ""],
        ["train", "--out", "x", "--init", ""],
        ["figures", "", "--out", "x"],
        ["fly", "--record", ""],
        ["train", "--out", "x", "--minutes", "inf"],
        ["train", "--out", "x", "--minutes", "1e300"],
    ],
)
def test_options_that_name_nothing_are_refused(command, tmp_path, monkeypatch, capsys):
    """Faults 17, 25: a run began in the current folder."""
    monkeypatch.chdir(tmp_path)
    complaint(capsys, main(command))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.fault("crafted files are refused")
def test_experiments_find_their_files_from_anywhere(tmp_path, monkeypatch):
    """Fault 18."""
    monkeypatch.chdir(tmp_path)
    learning_figure = program("training", "learning_figure")
    out = ["--out", str(tmp_path / "figure")]
    figure = learning_figure.LearningFigure
    assert script(figure, figure.__call__, out) == 0
    assert (tmp_path / "figure.svg").exists()
