"""The layout and the legend, read back: they name all that a mission has, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from reading import entities, static
from rerun.blueprint.components import LoopMode, PlayState
from rerun.chunk import RrdReader

from swarm_mj.replay.layout import WIDTH, legend_height
from swarm_mj.replay.links import NO_MISMATCH
from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.training_curve import TrainingCurve
from swarm_mj.replay.write import new_recording, send_layout, write_replay

ADDRESSED = {"delivered", "lost", "answered", "overheard"}
BROADCAST = {"transmits", "is heard by"}
ALWAYS = {"radio range", "r4's tree"}
MOVING = {"heading", "r4's belief"}
BEYOND = MOVING | {"r4's tree", "range in\nfree space"}  # of free space
MISMATCH = {"believed,\ntoo weak", "works,\nunbelieved", "cut off\nfrom r4"}

EVERYWHERE = {
    "Map, squares of 100 m",
    "Legend",
    "Tree of r4, in hops",
    "Age of row's knowledge of column",
    "Age of information [windows]: team ± std (green), r4 (white)",
    "Scene in 3-D, colours as on the map",
    "About this mission",
}
OF_ADDRESSED = "Packets in 10 windows: delivered (green), lost (orange), answered (blue)"
OF_BROADCASTS = "Packets in 10 windows: sent (grey), heard by anyone (blue)"
RADIO = "Radio of every robot: delivers (green), is lost (orange), answers (blue), overhears (pink)"
RADIO_OF_BROADCASTS = "Radio of every robot: transmits (blue), hears (dark)"
OF_FLOCKS = "Velocity variance [m²/s²]; a line: the flock has agreed"
OF_WORLDS = (
    "Link model errors [%]: predicted but dead (red), alive but not predicted (green); "
    "cut off (white)"
)

FLIGHTS = {  # by replay: the flight, its legend's texts and the plots beyond those of all
    "replay": ("two_way", ADDRESSED | ALWAYS | MOVING, {OF_ADDRESSED, OF_FLOCKS, RADIO}),
    "flood_replay": (
        "flooded",
        BROADCAST | ALWAYS | MOVING,
        {OF_BROADCASTS, OF_FLOCKS, RADIO_OF_BROADCASTS},
    ),
    "still_replay": ("still", ADDRESSED | ALWAYS, {OF_ADDRESSED, RADIO}),
    "blocked_replay": (
        "blocked",
        BROADCAST | BEYOND | MISMATCH,
        {OF_BROADCASTS, OF_WORLDS, RADIO_OF_BROADCASTS},  # it walks at random
    ),
}


def labels(path):
    """The legend's entities of texts."""
    return [e for e in entities(path) if e.startswith("/legend/") and e.endswith("/text")]


def texts(path):
    return {str(text) for of in labels(path) for text in static(path, of, "Points2D:labels")}


def views(path):
    """For each view its kind, its name, and what the layout says of it."""
    (layout,) = RrdReader(path).blueprints()
    batches = {
        chunk.entity_path: chunk.to_record_batch() for chunk in RrdReader(path).stream(store=layout)
    }
    for entity, batch in batches.items():
        if "ViewBlueprint:class_identifier" in batch.schema.names:
            kind, name = (
                batch.column(f"ViewBlueprint:{field}").to_pylist()[0][0]
                for field in ("class_identifier", "display_name")
            )
            yield kind, name, {path.rsplit("/")[-1] for path in batches if path.startswith(entity)}


@pytest.mark.parametrize("name", FLIGHTS)
def test_legend_and_views_name_what_the_mission_has(name, request):
    path, (flight, expected, plots) = request.getfixturevalue(name), FLIGHTS[name]
    assert {name for _, name, _ in views(path)} == EVERYWHERE | plots
    assert texts(path) == expected
    places = np.array([static(path, of, "Points2D:positions") for of in labels(path)])
    log = request.getfixturevalue(flight).log
    height = legend_height(log, 3 if log.is_compared else 2)
    assert np.all((places > 0.0) & (places < [WIDTH, height]))
    assert len(np.unique(places, axis=0)) == len(expected)


def test_no_mismatch_is_named_where_packets_only_fade(blocked, tmp_path):
    none = NO_MISMATCH._replace(window=blocked.log.mismatch.window)
    log = replace(blocked.log, mismatch=none, is_cut_off=np.zeros_like(blocked.log.is_cut_off))
    write_replay(log, {"seed": 5}, tmp_path / "a.rrd")
    assert texts(tmp_path / "a.rrd") == BROADCAST | BEYOND


def test_the_look_does_not_depend_on_the_viewer_s_theme(replay):
    for kind, name, said in views(replay):
        if kind in ("2D", "3D"):
            assert "Background" in said, name
        if kind == "TimeSeries":
            assert {"PlotBackground", "ScalarAxis", "PlotLegend"} <= said, name


def test_the_ramp_says_whose_knowledge_and_where_it_ends(replay):
    """12 robots have a turn each in a round of 12 windows; 15 is the next round number."""
    about = static(replay, "/legend/about_ages", "Points2D:labels")
    assert about.tolist() == ["age of what r4 knows"]
    first, _, last = static(replay, "/legend/ages", "Points2D:labels")
    end, unit = last.split()
    assert (first, end, unit) == ("0", "15", "windows")


@pytest.mark.parametrize(
    ("name", "entity", "component"),
    [
        ("radio_range", "/arena/radio/range", "Ellipses2D:colors"),
        ("r4_s_tree", "/arena/tree", "LineStrips2D:colors"),
    ],
)
def test_samples_wear_the_colours_of_the_map(replay, name, entity, component):
    assert static(replay, f"/legend/{name}", component) == static(replay, entity, component)


def test_a_training_has_a_tab_more_in_front_and_plays_on(still, tmp_path):
    curve = TrainingCurve(
        title="age of information [windows]",
        digits=2,
        decisions=np.array([0.0]),
        cost=np.array([9.0]),
        sem=np.array([0.5]),
        references={"tdma": 5.0},
    )
    names = {}
    panels = {}
    for name, its in (("flight", {}), ("training", {"curve": curve})):
        path = tmp_path / f"{name}.rrd"
        with new_recording(still.log, **its) as recording:
            recording.save(path)
            out = RerunLog([recording], still.log)
            send_layout(recording, out, is_live=True, **its)
        names[name] = sorted(each for _, each, _ in views(path))
        panels[name] = panel(path)
    more = [
        "Age of information [windows]: team ± std (green), r4 (white)",
        "First held-out mission, as the newest policy flies it",
        "Learning curve: age of information [windows] of held-out missions, over team decisions",
        "Legend",
    ]
    assert names["training"] == sorted([*names["flight"], *more])
    assert panels == {
        "flight": {"play_state": "Following", "loop_mode": "Off"},
        "training": {"play_state": "Playing", "loop_mode": "All"},
    }


def panel(path):
    """How the mission is played, and what follows its end."""
    (layout,) = RrdReader(path).blueprints()
    said = {}
    for chunk in RrdReader(path).stream(store=layout):
        batch = chunk.to_record_batch()
        for field, kind in (("play_state", PlayState), ("loop_mode", LoopMode)):
            column = f"TimePanelBlueprint:{field}"
            if column in batch.schema.names:
                said[field] = kind(batch.column(column).to_pylist()[0][0]).name
    return said
