"""The replay's layout, read back from the file."""

import pytest
from rerun.chunk import RrdReader

EVERYWHERE = {
    "Map, squares of 100 m",
    "Legend",
    "Tree of r4, in hops",
    "Age of information, all pairs",
    "Age of information [windows]: team ± std (green), r4 (white)",
    "Scene in 3-D, colours as on the map",
    "Radio of every robot",
    "About this mission",
}
OF_ADDRESSED = "Packets in 10 windows: delivered (green), lost (orange), answered (blue)"
OF_BROADCASTS = "Packets in 10 windows: sent (grey), heard by anyone (blue)"
OF_FLOCKS = "Velocity variance [m²/s²]"
OF_WORLDS = "Share [%]: believed, too weak (red); works, unbelieved (green); cut off (white)"


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


@pytest.mark.parametrize(
    ("replay_name", "names"),
    [
        ("replay", {OF_ADDRESSED, OF_FLOCKS}),
        ("flood_replay", {OF_BROADCASTS, OF_FLOCKS}),
        ("still_replay", {OF_ADDRESSED}),
        ("blocked_replay", {OF_BROADCASTS, OF_FLOCKS, OF_WORLDS}),
    ],
)
def test_views_are_of_what_the_mission_has(replay_name, names, request):
    shown = views(request.getfixturevalue(replay_name))
    assert {name for _, name, _ in shown} == EVERYWHERE | names


def test_the_look_does_not_depend_on_the_viewer_s_theme(replay):
    for kind, name, said in views(replay):
        if kind in ("2D", "3D"):
            assert "Background" in said, name
        if kind == "TimeSeries":
            assert {"PlotBackground", "ScalarAxis", "PlotLegend"} <= said, name
