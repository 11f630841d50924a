"""Files that others hand us, damaged or crafted: one line says so, and the exit code is 2."""

import csv
import zipfile
from dataclasses import asdict

import numpy as np
import pytest
import synthetic
from damage import complaint, damaged, program, put_no_file, told_or_read
from tiny_policies import save_tiny

import swarm_mj
from swarm_mj.cli import main, script
from swarm_mj.evaluation.missions_table import read_missions, write_missions
from swarm_mj.evaluation.results import COLUMNS
from swarm_mj.evaluation.results_files import read_results, write_results
from swarm_mj.learning.run_folder import read_curve
from swarm_mj.mission import paper
from swarm_mj.policies.stored import read_policy
from swarm_mj.policies.tuning import TABLE, read_table

LEARNING = """decisions,minutes,aoi,aoi_sem,tdma
0,0.1,55.1,1.4,24.4
8192,0.6,32.7,1.1,24.4
16384,1.1,30.1,1.0,24.4
"""


@pytest.mark.slow
@pytest.mark.fault("damaged files are told")
def test_damaged_replays_are_told_by_all_readers(tmp_path, capsys, tries):
    """Fault 11: a flip in what a replay holds was shown as if it had been flown, or crashed."""
    picture, path = program("tools", "picture"), tmp_path / "a.rrd"
    flight = ["fly", "--policy", "tdma", "--robots", "5", "--windows", "5", "--record", str(path)]
    assert main(flight) == 0
    capsys.readouterr()
    for _ in damaged(path, tries):
        assert "is no whole replay: damaged" in complaint(capsys, main(["replay", str(path)]))
        with pytest.raises(ValueError, match="is no whole replay: damaged"):
            picture.take_picture(path, None, tmp_path / "a.png", "1600x900", 0)


@pytest.mark.fault("damaged files are told")
@pytest.mark.parametrize("what", ["results", "table", "policy", "curve"])
def test_damaged_files_are_told_or_sound(what, tmp_path, tries):
    """Faults 15, 16: what cannot be read is told in a line."""
    path = tmp_path / "file.safetensors"
    write, read = {
        "results": (lambda: write_results(path, synthetic.everything()), read_results),
        "table": (lambda: path.write_text("".join(TABLE.open().readlines()[:5])), read_table),
        "policy": (lambda: save_tiny(path), read_policy),
        "curve": (lambda: path.write_text(LEARNING), read_curve),
    }[what]
    write()
    for _ in damaged(path, tries):
        told_or_read(lambda: read(path))


@pytest.mark.fault("damaged files are told")
def test_damaged_missions_are_told_or_sound(tmp_path, tries):
    """Whatever is flipped or cut, `study compare` says so in a line, or compares."""
    path = tmp_path / "m.parquet"
    mission = paper(num_robots=3, num_windows=3, range_ratio=1.0)
    write_missions(path, swarm_mj.evaluate("tdma", mission, num_missions=3).results)
    for _ in damaged(path, tries):
        told_or_read(lambda: read_missions(path))


def with_cells(path, **cells):
    """Results of which the first has other cells."""
    rows = [asdict(each) for each in synthetic.everything()]
    rows[0] |= cells
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    return str(path)


CELLS = [{"num_windows": "12x"}, {"aoi_mean": "1e400"}, {"task": ""}, {"preset": "mine"}]


@pytest.mark.fault("crafted files are refused")
def test_crafted_results_are_refused(tmp_path, capsys, record_property):
    """Fault 15: texts for numbers, an unknown preset."""
    for cells in CELLS:
        path = with_cells(tmp_path / "r.csv", **cells)
        complaint(capsys, main(["figures", path, "--out", str(tmp_path / "out")]))
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
    put_no_file(tmp_path / "x", kind)
    name, out = str(tmp_path / "x"), str(tmp_path / "out")
    tune, weights = program("tools", "tune"), program("tools", "reference_policy")
    codes = [
        lambda: main(["replay", name]),
        lambda: main(["figures", name, "--out", out]),
        lambda: main(["fly", "--no-record", "--policy", name]),
        lambda: script(weights.Options, weights.run, [name]),
        lambda: script(tune.Options, tune.run, ["--policy", "mst", "--out", name]),
    ]
    for code in codes:
        complaint(capsys, code())
    record_property("tries", len(codes))


@pytest.mark.fault("crafted files are refused")
def test_weights_of_others_are_arrays_and_no_bombs(tmp_path, capsys, tries):
    """Fault 16: empty and damaged zips gave tracebacks."""
    weights, path = program("tools", "reference_policy"), tmp_path / "w.npz"
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr("policy.npy", bytes(10**8))
    np.save(tmp_path / "one.npy", np.zeros(3))
    np.savez(path, a=np.zeros(50))
    crafted = [(tmp_path / name).read_bytes() for name in ("bomb.npz", "one.npy")]
    for _ in damaged(path, tries, [b"", b"PK\x05\x06" + bytes(18), *crafted]):
        assert told_or_read(lambda: weights.network_of(path)) is None
    complaint(capsys, script(weights.Options, weights.run, [str(path)]))


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
def test_options_that_name_nothing_are_refused(command, here, capsys):
    """Faults 17, 25: a run began in the current folder."""
    complaint(capsys, main(command))
    assert list(here.iterdir()) == []


@pytest.mark.fault("crafted files are refused")
def test_experiments_find_their_files_from_anywhere(here):
    """Fault 18."""
    figure = program("training", "readme_figure").ReadmeFigure
    assert script(figure, figure.__call__, ["--out", "figure"]) == 0
    assert (here / "figure.svg").exists()
