"""The legend names everything that the map shows, and nothing else."""

import numpy as np
import pytest
from reading import static
from rerun.chunk import RrdReader

ADDRESSED = {"delivered", "lost", "answered", "overheard"}
BROADCAST = {"transmits", "is heard by"}
ALWAYS = {"radio range", "r4's tree"}
MOVING = {"heading", "r4's belief"}


def texts(path):
    """All texts of the legend."""
    entities = {
        chunk.entity_path
        for chunk in RrdReader(path).stream()
        if chunk.entity_path.startswith("/legend/") and chunk.entity_path.endswith("/text")
    }
    return {str(text) for entity in entities for text in static(path, entity, "Points2D:labels")}


def test_of_addressed_packets(replay):
    assert texts(replay) == ADDRESSED | ALWAYS | MOVING


def test_of_broadcasts(flood_replay):
    assert texts(flood_replay) == BROADCAST | ALWAYS | MOVING


def test_of_a_team_at_rest(still_replay):
    assert texts(still_replay) == ADDRESSED | ALWAYS


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
