"""The legend names everything that the map shows, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from reading import static
from rerun.chunk import RrdReader

from swarm_mj.replay.legend import WIDTH, height
from swarm_mj.replay.write import write_replay

ADDRESSED = {"delivered", "lost", "answered", "overheard"}
BROADCAST = {"transmits", "is heard by"}
ALWAYS = {"radio range", "r4's tree"}
MOVING = {"heading", "r4's belief"}
BEYOND = MOVING | {"r4's tree", "range in\nfree space"}  # of free space
MISMATCH = {"believed,\ntoo weak", "works,\nunbelieved", "cut off\nfrom r4"}


def labels(path):
    """The entities of all samples' texts."""
    return {
        chunk.entity_path
        for chunk in RrdReader(path).stream()
        if chunk.entity_path.startswith("/legend/") and chunk.entity_path.endswith("/text")
    }


def texts(path):
    """All texts of the legend."""
    return {str(text) for of in labels(path) for text in static(path, of, "Points2D:labels")}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("replay", ADDRESSED | ALWAYS | MOVING),
        ("flood_replay", BROADCAST | ALWAYS | MOVING),
        ("still_replay", ADDRESSED | ALWAYS),
        ("blocked_replay", BROADCAST | BEYOND | MISMATCH),
    ],
)
def test_all_that_is_shown_is_named(name, expected, request):
    assert texts(request.getfixturevalue(name)) == expected


def test_no_mismatch_is_named_where_packets_only_fade(blocked, tmp_path):
    none = blocked.log.mismatch.chosen(np.s_[:0])
    log = replace(blocked.log, mismatch=none, group=np.zeros_like(blocked.log.group))
    write_replay(log, blocked.mission, {"seed": 5}, tmp_path / "a.rrd")
    assert texts(tmp_path / "a.rrd") == BROADCAST | BEYOND


@pytest.mark.parametrize(
    ("name", "flight"),
    [
        ("replay", "two_way"),
        ("flood_replay", "flooded"),
        ("still_replay", "still"),
        ("blocked_replay", "blocked"),
    ],
)
def test_texts_stand_within_the_view_and_none_on_another(name, flight, request):
    path, log = request.getfixturevalue(name), request.getfixturevalue(flight).log
    places = np.array([static(path, of, "Points2D:positions") for of in labels(path)])
    assert np.all((places > 0.0) & (places < [WIDTH, height(log)]))
    assert len(np.unique(places, axis=0)) == len(texts(path))


def test_the_ramp_says_whose_knowledge_and_where_it_ends(replay, two_way):
    about = static(replay, "/legend/about_ages", "Points2D:labels")
    assert about.tolist() == ["age of what r4 knows"]
    first, _, last = static(replay, "/legend/ages", "Points2D:labels")
    assert first == "0"
    end, unit = last.split()
    assert unit == "windows"
    assert np.mean(two_way.log.age <= float(end)) >= 0.95


@pytest.mark.parametrize("name", ["radio_range", "r4_s_tree"])
def test_samples_wear_the_colours_of_the_map(replay, name):
    entity, component = {
        "radio_range": ("/arena/radio/range", "Ellipses2D:colors"),
        "r4_s_tree": ("/arena/tree", "LineStrips2D:colors"),
    }[name]
    assert static(replay, f"/legend/{name}", component) == static(replay, entity, component)
