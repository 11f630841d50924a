"""The experiment evaluates what is missing, once, and shows results when all are there."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import paper_figures as experiment
import pytest
from synthetic import result

from swarm_mj.cli import parse
from swarm_mj.evaluation.published import points, published
from swarm_mj.evaluation.results import read_results, write_results
from swarm_mj.policies.registry import POLICIES

NAMES = [
    f"{preset}-{task}.csv"
    for preset in ("paper", "reference")
    for task in ("stationary", "random-walk", "flocking")
]


@pytest.fixture
def calls(monkeypatch):
    """The commands called; instead of flying, each writes its name as a result, or is broken."""
    calls = SimpleNamespace(seen=[], broken=set(), commit="abc")

    def command(arguments):
        calls.seen.append(arguments)
        path = Path(arguments[arguments.index("--csv") + 1])
        if path.name in calls.broken:
            return 130
        path.parent.mkdir(parents=True, exist_ok=True)
        write_results(path, [replace(result("mst"), commit=calls.commit)])
        return 0

    monkeypatch.setattr(experiment, "commit", lambda: "abc")
    monkeypatch.setattr(experiment, "swarm_mj", command)
    return calls


@pytest.fixture
def settings(tmp_path):
    return experiment.Settings(results=tmp_path / "results", drafts=tmp_path / "drafts")


def files(folder):
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_the_commands_cover_every_published_regime(calls, settings):
    assert experiment.evaluate(settings, 3, force=False) == 0
    studies = [parse(arguments)[1].study for arguments in calls.seen]
    assert all((study.episodes, study.seed) == (50, 2000) for study in studies)
    for study in studies:
        left_out = {"age-gain-csma", "csma", "sotdma"}
        if study.regimes[0].preset == "reference":
            left_out |= {"planner", "planner --payload none", "gnn"}
        if study.regimes[0].task != "stationary":  # there it is spatial-tdma
            left_out |= {"planner --payload none"}
        assert set(study.policies) == set(POLICIES) - left_out
        assert study.compared_to == "tdma"
    found = [
        (regime.preset, point)
        for study in studies
        for regime in study.regimes
        for point in published("mst", regime).values()
    ]
    wanted = [p for p in points() if p.method == "mst" and p.figure != "fig3_receptive_field"]
    assert len(found) == 2 * len(wanted)
    assert set(found) == {(preset, point) for preset in settings.presets for point in wanted}
    assert {arguments[arguments.index("--jobs") + 1] for arguments in calls.seen} == {"3"}


def test_what_is_there_is_kept(calls, settings):
    settings.results.mkdir()
    (settings.results / NAMES[0]).write_text("mine")
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(calls.seen) == 5
    assert all("--resume" in arguments and "--force" not in arguments for arguments in calls.seen)
    assert (settings.results / NAMES[0]).read_text() == "mine"
    assert files(settings.results) == sorted(NAMES)
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(calls.seen) == 5


def test_an_interruption_leaves_no_results_and_the_next_run_resumes(calls, settings):
    calls.broken.add(NAMES[2])
    assert experiment.evaluate(settings, 1, force=False) == 130
    assert files(settings.results) == []
    assert files(settings.drafts) == sorted(NAMES[:2])
    calls.broken.clear()
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(calls.seen) == 3 + 4
    assert files(settings.results) == sorted(NAMES)
    assert files(settings.drafts) == []


def test_force_makes_everything_again_and_is_resumed_without_it(calls, settings):
    experiment.evaluate(settings, 1, force=False)
    experiment.evaluate(settings, 1, force=True)
    assert len(calls.seen) == 12
    calls.broken.add(NAMES[1])
    assert experiment.evaluate(settings, 1, force=True) == 130
    assert files(settings.results) == []
    calls.broken.clear()
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(calls.seen) == 12 + 2 + 5


def test_drafts_of_another_commit_are_made_again(calls, settings):
    calls.commit = "def"
    calls.broken.add(NAMES[2])
    experiment.evaluate(settings, 1, force=False)
    calls.broken.clear()
    calls.commit = "abc"
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(calls.seen) == 3 + 6
    commits = {read_results(settings.results / name)[0].commit for name in NAMES}
    assert commits == {"abc"}
