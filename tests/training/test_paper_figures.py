"""The experiment evaluates what is missing, once, and hands it over whole."""

from dataclasses import replace
from pathlib import Path

import paper_figures as experiment
import pytest
from synthetic import result

from swarm_mj.cli import parse
from swarm_mj.evaluation.published import points, published
from swarm_mj.evaluation.results import read_results, write_csv

NAMES = [
    f"{preset}-{task}.csv"
    for preset in ("paper", "reference")
    for task in ("stationary", "random-walk", "flocking")
]


@pytest.fixture
def calls(monkeypatch):
    """The commands called; instead of flying, each writes itself as its result."""
    seen = []

    def command(arguments):
        seen.append(arguments)
        path = Path(arguments[arguments.index("--csv") + 1])
        if path.name in broken:
            return 130
        path.parent.mkdir(parents=True, exist_ok=True)
        write_csv(path, [replace(result("mst"), commit=made_by[0])])
        return 0

    broken, made_by = set(), ["abc"]
    monkeypatch.setattr(experiment, "commit", lambda: "abc")
    monkeypatch.setattr(experiment, "swarm_mj", command)
    return seen, broken, made_by


@pytest.fixture
def settings(tmp_path):
    return experiment.Settings(results=tmp_path / "results", drafts=tmp_path / "drafts")


def files(folder):
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_the_commands_cover_every_published_regime(calls, settings):
    seen, *_ = calls
    assert experiment.evaluate(settings, 3, force=False) == 0
    studies = [parse(arguments)[1].study for arguments in seen]
    assert all((study.episodes, study.seed) == (50, 2000) for study in studies)
    found = [
        (regime.preset, point)
        for study in studies
        for regime in study.regimes
        for point in published("mst", regime).values()
    ]
    wanted = [p for p in points() if p.policy == "mst" and p.figure != "fig3_receptive_field"]
    assert len(found) == 2 * len(wanted)
    assert set(found) == {(preset, point) for preset in settings.presets for point in wanted}
    assert {arguments[arguments.index("--jobs") + 1] for arguments in seen} == {"3"}


def test_what_is_there_is_kept(calls, settings):
    seen, *_ = calls
    settings.results.mkdir()
    (settings.results / NAMES[0]).write_text("mine")
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(seen) == 5
    assert all("--resume" in arguments and "--force" not in arguments for arguments in seen)
    assert (settings.results / NAMES[0]).read_text() == "mine"
    assert files(settings.results) == sorted(NAMES)
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(seen) == 5


def test_an_interruption_hands_over_nothing_and_the_next_run_goes_on(calls, settings):
    seen, broken, _ = calls
    broken.add(NAMES[2])
    assert experiment.evaluate(settings, 1, force=False) == 130
    assert files(settings.results) == []
    assert files(settings.drafts) == sorted(NAMES[:2])
    broken.clear()
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(seen) == 3 + 4
    assert files(settings.results) == sorted(NAMES)
    assert files(settings.drafts) == []


def test_force_makes_all_anew_and_if_interrupted_goes_on_without_it(calls, settings):
    seen, broken, _ = calls
    experiment.evaluate(settings, 1, force=False)
    experiment.evaluate(settings, 1, force=True)
    assert len(seen) == 12
    broken.add(NAMES[1])
    assert experiment.evaluate(settings, 1, force=True) == 130
    assert files(settings.results) == []
    broken.clear()
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(seen) == 12 + 2 + 5


def test_drafts_of_another_commit_are_made_anew(calls, settings):
    seen, broken, made_by = calls
    made_by[0] = "def"
    broken.add(NAMES[2])
    experiment.evaluate(settings, 1, force=False)
    broken.clear()
    made_by[0] = "abc"
    assert experiment.evaluate(settings, 1, force=False) == 0
    assert len(seen) == 3 + 6
    commits = {read_results(settings.results / name)[0].commit for name in NAMES}
    assert commits == {"abc"}
