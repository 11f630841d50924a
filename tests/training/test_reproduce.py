"""The paper's learned results are trained and flown as their files say, and gone on with."""

import csv
import json
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import reproduce as program
from experiments import FIGURES, PAPERS
from synthetic import result

from swarm_mj.cli import parse
from swarm_mj.evaluation.published import RESULT_FIGURES, points
from swarm_mj.evaluation.results_files import read_results, write_results
from swarm_mj.system.packages import commit

ROOT = Path(__file__).parents[2]
FILE = ROOT / "training" / "reproduce.py"
EXPERIMENT = """
[trainings]
narrow = "--receptive-field 0"
wide = "--receptive-field 1"

[flights]
"--robots 5" = {narrow = ["GNN", "linear GNN"], wide = ["GNN"]}
"--robots 6" = {wide = ["GNN generalized from 5"], tdma = ["a rule"]}

[quick]
train = "--robots 5 --windows 5 --missions 2 --held-out 1 --latent 4 --depth 1 --budget 64"
fly = "--task stationary --windows 5 --episodes 2 --seed 2000"

[full]
train = "--budget 40"
fly = "--episodes 3"
"""


class Tiny:
    """A tiny experiment in a folder: the options that lead to it, and where its files go."""

    def __init__(self, folder):
        self.file = folder / "fig3.toml"
        self.file.write_text(EXPERIMENT)
        self.results = folder / "results" / "quick"
        self.runs = folder / "runs" / "quick" / "fig3"
        self.options = ["--figures", "fig3", "--experiments", str(folder)]
        self.options += ["--results", str(folder / "results"), "--runs", str(folder / "runs")]
        self.options += ["--policies", str(folder / "policies")]
        self.kept = folder / "policies" / "quick" / "fig3"
        self.seen = []  # the commands that were called, where they are replaced
        self.broken = set()  # arguments of those that fail

    def __call__(self, *more):
        """Runs the program; returns its exit code."""
        return program.script(program.Settings, program.run, [*self.options, *more])


@pytest.fixture(scope="module")
def made(forks, tmp_path_factory):
    """A tiny experiment that was run, and how to run it again."""
    folder = tmp_path_factory.mktemp("made")
    tiny = Tiny(folder)
    done = forks.run(folder, FILE, *tiny.options)
    assert done.returncode == 0, done.stderr
    return tiny, lambda: forks.run(folder, FILE, *tiny.options)


@pytest.fixture
def tiny(tmp_path, made, monkeypatch):
    """A tiny experiment whose commands copy what they left when it was made, or fail."""
    tiny = Tiny(tmp_path)

    def command(arguments):
        tiny.seen.append(arguments)
        if tiny.broken & set(arguments):
            return 130
        if arguments[0] == "train":
            run = Path(arguments[arguments.index("--out") + 1])
            shutil.copytree(made[0].runs / run.name, run)
        else:
            start, end = arguments.index("--policy") + 1, arguments.index("--task")
            paths = arguments[start:end]
            rows = [replace(result(p, baseline=paths[0]), commit=commit()) for p in paths]
            write_results(Path(arguments[arguments.index("--csv") + 1]), rows)
        return 0

    monkeypatch.setattr(program, "swarm_mj", command)
    return tiny


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_tiny_experiment_from_nothing_to_its_tables(made):
    tiny, again = made
    results, runs = tiny.results, tiny.runs
    assert names(results) == ["fig3.csv"]
    kept = ["curves.csv", "narrow.safetensors", "trainings.csv", "wide.safetensors"]
    assert names(tiny.kept) == kept
    for name in ("narrow", "wide"):
        stored = (tiny.kept / f"{name}.safetensors").read_bytes()
        assert stored == (runs / name / "policy.safetensors").read_bytes()

    flown = read_results(results / "fig3.csv")
    assert [(r.policy, r.num_robots, r.baseline) for r in flown] == [
        ("GNN", 5, "narrow"),
        ("linear GNN", 5, "narrow"),
        ("GNN", 5, "narrow"),
        ("GNN generalized from 5", 6, "wide"),
        ("a rule", 6, "wide"),
    ]
    *configs, rule = [json.loads(result.config) for result in flown]
    assert [each["policy"] for each in configs] == ["narrow", "narrow", "wide", "wide"]
    assert [each["receptive_field"] for each in configs] == [0, 0, 1, 1]
    assert {(each["decisions"], each["num_windows"]) for each in configs} == {(64, 5)}
    assert (rule["policy"], "decisions" in rule) == ("tdma", False)

    trained = rows(tiny.kept / "trainings.csv")
    assert [row["training"] for row in trained] == ["narrow", "wide"]
    settings = [json.loads(row["settings"]) for row in trained]
    assert [each["network"]["receptive_field"] for each in settings] == [0, 1]
    assert {row["commit"] for row in trained} == {result.commit for result in flown}

    curves = rows(tiny.kept / "curves.csv")
    for name in ("narrow", "wide"):
        own = [row["aoi"] for row in curves if row["training"] == name]
        assert own == [row["aoi"] for row in rows(runs / name / "curve.csv")]
        assert len(own) == 2  # untrained, and at the end

    done = again()
    assert done.returncode == 0
    assert "fig3.csv is there; --force makes it anew" in done.stderr


@pytest.mark.slow
def test_it_resumes_where_it_broke_off(tiny):
    for broken in ("wide", "flights-1.csv"):
        tiny.broken = {str(tiny.runs / broken)}
        assert tiny() == 130
        assert not tiny.results.exists()
    tiny.broken.clear()
    assert tiny() == 0
    outputs = [
        Path(each[each.index("--out" if each[0] == "train" else "--csv") + 1]).name
        for each in tiny.seen
    ]
    assert " ".join(outputs) == "narrow wide wide flights-0.csv flights-1.csv flights-1.csv"
    assert names(tiny.results) == ["fig3.csv"]


@pytest.mark.slow
def test_trained_policies_fly_again_at_another_commit_without_training(tiny, monkeypatch):
    assert tiny() == 0
    shutil.rmtree(tiny.runs)  # as in a clone
    tiny.seen.clear()
    monkeypatch.setattr(program, "commit", lambda: "of another code")
    assert tiny("--fly", "--episodes 1") == 0
    assert [command[0] for command in tiny.seen] == ["evaluate", "evaluate"]
    assert [parse(command)[1].episodes for command in tiny.seen] == [1, 1]


@pytest.mark.slow
def test_runs_of_another_experiment_or_commit_are_not_resumed(tiny, capsys):
    tiny.broken.add(str(tiny.runs / "narrow"))
    assert tiny() == 130
    tiny.file.write_text(EXPERIMENT.replace("--budget 64", "--budget 32"))
    assert tiny() == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert str(tiny.runs) in said
    assert "give --force to start over" in said
    begun = json.loads((tiny.runs / "begun.json").read_text())
    tiny.file.write_text(EXPERIMENT)
    (tiny.runs / "begun.json").write_text(json.dumps(begun | {"commit": "abc"}))
    assert tiny() == 2
    assert len(tiny.seen) == 1
    assert tiny("--force") == 130
    assert json.loads((tiny.runs / "begun.json").read_text()) == begun
    assert not tiny.results.exists()


def test_own_options_take_the_place_of_shared_ones():
    typed = program.typed("--robots 10 20 --linear --seed 1", "--seed 2 --robots 40")
    assert typed == ["--robots", "40", "--linear", "--seed", "2"]


def test_a_folder_of_something_else_is_left_alone(tiny, capsys):
    (tiny.runs / "mine").mkdir(parents=True)
    tiny.results.mkdir(parents=True)
    (tiny.results / "fig3.csv").write_text("kept\n")
    for force in ((), ("--force",)):
        assert tiny(*force) == 2
        assert "is there, but no runs of this; name other --runs" in capsys.readouterr().err
    assert (tiny.runs / "mine").exists()
    assert (tiny.results / "fig3.csv").read_text() == "kept\n"
    assert tiny.seen == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[full]", "[fool]", "fool"),
        ("fly =", "flies =", "flies"),
        ("{wide =", "{wider =", "flies 'wider', but trains only narrow, wide"),
        ("--depth", "--deepness", "--deepness"),
        ("--budget 64", "--budget none", "budget"),
        ('"--receptive-field 0"', '"wide"', "options begin with --, and not with 'wide'"),
        ('["GNN"]', "1", "Expected `array`"),
    ],
)
def test_a_wrong_experiment_is_refused_before_any_work(tiny, capsys, old, new, said):
    tiny.file.write_text(EXPERIMENT.replace(old, new))
    assert tiny() == 2
    assert said in capsys.readouterr().err
    assert tiny.seen == []


@pytest.mark.slow
@pytest.mark.parametrize("figure", ["fig3", "fig4", "fig5", "fig6"])
def test_an_experiment_flies_all_points_of_its_figure(figure):
    work = program.read_work(figure, program.Settings())
    shown = RESULT_FIGURES[figure]
    flown = set()
    for _, command, _ in work.flights:
        options = parse(command)[1]
        episodes = 40 if figure == "fig3" else 100
        assert (options.seed, options.episodes) == (4500, episodes)  # as the baselines' missions
        for mission in options.missions:
            assert (mission.task, mission.preset) == (shown.task, "paper")
            flown.add(getattr(mission, shown.x_name, None))
    if shown.sweeps_missions:
        assert flown == set(shown.xs)
    else:
        hops = [parse(command)[1].settings for command in work.trainings.values()]
        assert {each["network.receptive_field"] for each in hops} == set(shown.xs)


@pytest.mark.parametrize("figure", PAPERS)
def test_full_has_the_authors_budget_and_never_stops_before(figure):
    work = program.read_work(figure, program.Settings(scale="full"))
    options = parse(next(iter(work.trainings.values())))[1]
    assert (options.budget, options.patience) == (2_000_000, 0)
    assert options.settings["network.latent"] == 64
    parse(work.flights[0][1])


# Of fewer missions than the paper's 100: 66 networks fly for Fig. 3.
SMALLER = {"fig3": 40, "tutorial": 50}


@pytest.mark.parametrize("figure", FIGURES)
def test_networks_fly_as_many_missions_as_the_papers(figure):
    work = program.read_work(figure, program.Settings())
    flown = {parse(command)[1].episodes for _, command, _ in work.flights}
    assert flown == {SMALLER.get(figure, 100)}
    assert {int(row["episodes"]) for row in rows(work.tables.flights)} == flown


TASKS = {"fig4": "stationary", "fig5": "random-walk", "fig6": "flocking"}


def test_the_one_network_is_below_the_published_gnns_at_every_point_of_three_figures():
    """In age and velocity variance, in each of its three trainings."""
    flown = rows(program.read_work("one", program.Settings()).tables.flights)
    num_compared = 0
    for point in points():
        task = TASKS.get(point.figure.partition("_")[0])
        if task is None or not point.method.startswith("GNN"):
            continue
        ours = [
            float(row[f"{point.cost}_mean"])
            for row in flown
            if row["task"] == task and float(row[point.x_name]) == point.x
        ]
        assert len(ours) == 3
        assert max(ours) < point.mean, point
        num_compared += len(ours)
    assert num_compared == 3 * (5 + 2 * 5 + 2 * 2 * 4)


@pytest.mark.parametrize("figure", FIGURES)
def test_committed_policies_are_of_the_experiment_as_it_stands(figure):
    work = program.read_work(figure, program.Settings())
    assert work.is_trained, "make reproduce trains them anew"
    assert len({row["commit"] for row in rows(work.tables.trainings)}) == 1


def options_of(words):
    """The values of each option but --out, by its flag."""
    found = {}
    for word in words:
        if word.startswith("--"):
            found[word] = []
        else:
            found[list(found)[-1]].append(word)
    del found["--out"]
    return found


def test_the_page_has_the_commands_of_the_recipes():
    text = (ROOT / "docs" / "training.md").read_text(encoding="utf-8")
    section = text.partition("## Six recipes\n")[2].partition("\n## ")[0]
    commands = re.findall(r"^swarm-mj train (.*) --out runs/(\w+)$", section, re.MULTILINE)
    trainings = program.read_work("recipes", program.Settings()).trainings
    assert {name for _, name in commands} == set(trainings)
    for options, name in commands:
        its = options_of([*shlex.split(options), "--out"])
        assert its == options_of(trainings[name][1:]), name
