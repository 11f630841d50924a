"""`swarm-mj curves`: what it prints and draws of run folders, and what it refuses."""

import shutil
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

from swarm_mj.api.charts import LearningCurve, draw_learning
from swarm_mj.cli import main
from swarm_mj.cli.curves import _lines, _read
from swarm_mj.evaluation.figures.style import CAPTION
from swarm_mj.learning.run_folder import Limits, TrainingRun, write_run
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import paper

MISSION = paper("stationary", num_robots=5)
FIRST = "decisions,minutes,aoi,aoi_sem,aoi_tdma,train/entropy\n0,0.5,60,4,26.25,\n"
CURVES = {  # evaluations of runs: the second has one more, that the first does not have
    "runs/a-1": FIRST + "100,1,30,2,26.25,0.5\n200,2,34,1,26.25,nan\n",
    "runs/a-2": FIRST + "100,1,20,2,26.25,0.5\n200,2,24,1,26.25,0.5\n250,3,23,1,26.25,0.5\n",
}


def put_run(folder, curve, seed=1, mission=MISSION, robots=(5,)):
    folder.mkdir(parents=True)
    training = usual_settings("robot", mission, robots, seed)
    write_run(folder, TrainingRun(training=training, limits=Limits(decisions=100)))
    if curve is not None:
        (folder / "curve.csv").write_text(curve)


def change(folder, before, after):
    """Changes a run's settings as they are stored."""
    settings = folder / "settings.json"
    text = settings.read_text()
    assert before in text
    settings.write_text(text.replace(before, after))


@pytest.fixture
def runs(here):
    for seed, (name, curve) in enumerate(CURVES.items(), start=1):
        put_run(here / name, curve, seed)
    return here


def test_a_line_a_run_and_the_references(runs, capsys):
    assert main(["curves", "runs/a-1", "runs/a-2", "runs/a-1"]) == 0
    printed = capsys.readouterr().out
    heading, *lines = [line.split() for line in printed.splitlines()]
    assert heading == ["run", "seed", "decisions", "best", "age", "last", "age", "[windows]"]
    assert lines == [
        ["runs/a-1", "1", "200", "30.00", "34.00"],
        ["runs/a-2", "2", "250", "20.00", "23.00"],
        ["tdma", "26.25"],
    ]
    assert not list(runs.glob("*.png"))


def test_the_last_policy_is_compared_with_the_references_on_the_same_missions(here, capsys):
    columns = "aoi_tdma,aoi_greedy_oracle,aoi_behind_tdma,aoi_behind_tdma_sem"
    columns += ",aoi_behind_greedy_oracle,aoi_behind_greedy_oracle_sem"
    rows = ("0,0.5,60,4,26,12,34,3,48,4", "100,1,30,2,26,12,0.87,1.3,14,2")
    put_run(here / "a", "\n".join([f"decisions,minutes,aoi,aoi_sem,{columns}", *rows, ""]))
    assert main(["curves", "a"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "a: the last policy shows no significant difference from tdma (0.87 ± 1.30 windows); "
        "loses to greedy-oracle by 14.00 ± 2.00 windows."
    )


def test_a_run_that_began_with_a_stored_policy_is_a_line_of_its_own(runs):
    put_run(runs / "b", FIRST, seed=2)
    whole = [_read(runs / name) for name in ("runs/a-1", "b")]
    assert len(_lines(whole)) == 1
    write_run(runs / "b", replace(whole[1].asked, init=Path("/a/policy.safetensors")))
    assert len(_lines([whole[0], _read(runs / "b")])) == 2


def test_seeds_are_one_line_in_the_band_of_their_range_and_other_settings_another(runs):
    put_run(runs / "b", FIRST, mission=MISSION, seed=7)
    change(runs / "b", '"latent": 32', '"latent": 16')
    lines = _lines([_read(runs / name) for name in (*CURVES, "b")])
    seeds, alone = lines.items()
    assert seeds[0] == "latent 32, 2 seeds"
    np.testing.assert_array_equal(seeds[1].decisions, [0, 100, 200])
    np.testing.assert_array_equal(seeds[1].age, [60, 25, 29])
    np.testing.assert_array_equal(seeds[1].low, [60, 20, 24])
    np.testing.assert_array_equal(seeds[1].high, [60, 30, 34])
    assert alone[0] == "latent 16"
    assert alone[1].decisions.tolist() == [0]
    assert alone[1].low.tolist() == alone[1].age.tolist() == alone[1].high.tolist() == [60]


def test_a_line_is_called_by_what_tells_it_apart_or_else_by_its_folder(runs):
    whole = [_read(runs / name) for name in CURVES]
    assert list(_lines(whole)) == ["2 seeds"]
    assert list(_lines(whole[:1])) == [f"{runs}/runs/a-1"]
    change(runs / "runs/a-2", '"kept": 0.95', '"kept": 0.9')  # is no option
    lines = list(_lines([_read(runs / name) for name in CURVES]))
    assert lines == [f"{runs}/runs/a-1", f"{runs}/runs/a-2"]
    change(runs / "runs/a-2", '"num_epochs": 2', '"num_epochs": 3')
    assert list(_lines([_read(runs / name) for name in CURVES])) == ["epochs 2", "epochs 3"]


def test_a_table_has_a_row_a_run_and_the_options_that_differ(runs, capsys):
    change(runs / "runs/a-2", '"num_epochs": 2', '"num_epochs": 3')
    assert main(["curves", *CURVES, "--csv", "a.csv"]) == 0
    assert "Wrote a.csv" in capsys.readouterr().out
    assert (runs / "a.csv").read_text().splitlines() == [
        "run,seed,epochs,decisions,aoi_best,aoi_last,aoi_last_sem,aoi_tdma",
        "runs/a-1,1,2,200,30.0,34.0,1.0,26.25",
        "runs/a-2,2,3,250,20.0,23.0,1.0,26.25",
    ]
    assert main(["curves", *CURVES, "--csv", "a.csv"]) == 2
    assert "a.csv exists" in capsys.readouterr().err


def test_no_two_lines_look_alike_and_the_legend_covers_none():
    course = np.array([60.0, 25.0])
    curve = LearningCurve(decisions=np.array([0.0, 1.0]), age=course, low=course, high=course)
    labels = [f"learning rate 0.000{n}, silence logit 5.5, 2 seeds" for n in range(9)]
    figure = draw_learning(dict.fromkeys(labels, curve), {"tdma": 26.25, "spatial-tdma": 20}, "x")
    (axes,) = figure.axes
    looks = {(to_hex(line.get_color()), line.get_linestyle()) for line in axes.lines}
    assert len(looks) == 11
    tdma = axes.lines[-2].get_color()
    assert all(to_hex(line.get_color()) != to_hex(tdma) for line in axes.lines[:9])
    figure.draw_without_rendering()
    legend = axes.get_legend().get_window_extent()
    assert legend.x0 >= axes.get_window_extent().x1
    assert legend.y0 >= 0.0
    assert legend.x1 <= figure.bbox.x1
    plt.close(figure)


def test_lines_bands_and_levels_stand_where_they_should():
    curve = LearningCurve(
        decisions=np.array([0.0, 100.0]),
        age=np.array([60.0, 25.0]),
        low=np.array([60.0, 20.0]),
        high=np.array([60.0, 30.0]),
    )
    figure = draw_learning({"mine $": curve}, {"tdma": 26.25}, "an origin")
    (axes,) = figure.axes
    drawn, level = axes.lines
    assert (drawn.get_xdata().tolist(), drawn.get_ydata().tolist()) == ([0, 100], [60, 25])
    assert level.get_ydata()[0] == 26.25
    (band,) = axes.collections
    corners = {tuple(corner) for corner in band.get_paths()[0].vertices}
    assert corners >= {(100.0, 20.0), (100.0, 30.0)}
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == [r"mine \$", "tdma 26.2"]
    (caption,) = figure.findobj(lambda artist: artist.get_gid() == CAPTION)
    assert caption.get_text() == "an origin"
    plt.close(figure)


def test_the_figure_is_written_and_replaced_only_by_force(runs, capsys):
    command = ["curves", *CURVES, "--plot", "a.svg"]
    assert main(command) == 0
    assert "Wrote a.svg" in capsys.readouterr().out
    assert "evaluated on --task stationary --robots 5 --held-out 12" in (runs / "a.svg").read_text()
    assert main(command) == 2
    assert "a.svg exists" in capsys.readouterr().err
    assert main([*command, "--force"]) == 0
    plt.close("all")


REFUSED = {
    "nowhere": "nowhere is no run; name a folder that `swarm-mj train` wrote",
    "runs": "runs is no run",
    "fresh": "fresh has no evaluation yet; wait for one, or train on by --resume",
    "empty": "empty has no evaluation yet",
    "other": "other/curve.csv is no learning curve, of decisions and aoi: 'decisions'",
    "words": "words/curve.csv is no learning curve, of decisions and aoi: could not convert",
    "cut": "cut/settings.json are damaged",
    "runs/a-1 large": "missions differ, --task stationary --robots 5 --held-out 12 and --task "
    "stationary --robots 6 7 --held-out 12; draw these runs apart",
    "runs/a-1 --plot a.gif": "--plot must be named *.png or *.svg or *.pdf",
    "": "the following arguments are required: RUN",
}


@pytest.mark.parametrize("line", REFUSED)
def test_what_is_no_run_or_of_other_missions_is_one_clear_line(runs, capsys, line):
    curves = {"fresh": None, "empty": FIRST.splitlines()[0], "other": "a,b\n1,2\n"}
    curves |= {"words": FIRST + "x,1,2,3,4,5\n", "cut": FIRST}
    for name, curve in curves.items():
        put_run(runs / name, curve)
    put_run(runs / "large", FIRST, mission=paper("stationary", num_robots=6), robots=(6, 7))
    settings = runs / "cut" / "settings.json"
    settings.write_text(settings.read_text()[:-40])
    assert main(["curves", *line.split()]) == 2
    printed = capsys.readouterr()
    assert REFUSED[line] in printed.err
    assert (printed.out, printed.err.count("\n")) == ("", 1)


def test_a_run_with_features_of_ones_own_is_shown_without_loading_them(runs, capsys):
    settings = runs / "runs/a-1/settings.json"
    settings.write_text(settings.read_text().replace('"extended"', '"unknown_module:Ages"'))
    shutil.rmtree(runs / "runs/a-2")
    assert main(["curves", "runs/a-1"]) == 0
    assert "runs/a-1" in capsys.readouterr().out
