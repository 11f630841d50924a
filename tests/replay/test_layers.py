"""Every layer that is declared is written by some mission, and shown by a view of the layout."""

from dataclasses import replace

import numpy as np
import pytest
from declared import where_text
from reading import entities
from rerun.chunk import RrdReader

from swarm_mj.replay import layers
from swarm_mj.replay.layer_kinds import Entity, FlatLayer, ReplayLayer, View, of_others
from swarm_mj.replay.palette import PACKETS
from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.training_curve import TrainingCurve, draw_training_curve
from swarm_mj.replay.write import new_recording, send_layout, write_replay

# Where layers are drawn, and nothing without one: other entities are solids, images and texts.
DRAWN = (
    "arena/",
    "learning/",
    "tree/",
    "state/now",
    "scene/grid",
    "scene/heading",
    "scene/packets",
    "scene/thrust",
    "scene/wind",
    "scene/world",
)


def declared(kind):
    """All constants of this kind by their names, and those by a fate or a kind of link."""
    found = {}
    for name, value in vars(layers).items():
        if isinstance(value, kind):
            found[name] = value
        elif isinstance(value, dict):
            found |= {f"{name} {key}": each for key, each in value.items()}
    return {name: each for name, each in found.items() if isinstance(each, kind)}


@pytest.fixture(scope="module")
def written(replay, flood_replay, blocked_replay, two_way, high, tmp_path_factory):
    """The replays of missions that differ in what they have: one has a wind, and one no walls."""
    facts = two_way.log.facts
    facts = replace(facts, mission=replace(facts.mission, boundary="none"))
    path = tmp_path_factory.mktemp("open") / "free.rrd"
    variance = np.linspace(1.0, 0.0, len(two_way.log.window))  # it agrees in the end
    log = replace(two_way.log, facts=facts, velocity_variance_m2ps2=variance)
    write_replay(log, {"seed": 5}, path)
    windy = path.with_name("windy.rrd")
    mission = replace(high.log.facts.mission, wind_mps=4.0)
    wind_mps = np.full((len(high.log.window), 2), 4.0)
    facts = replace(high.log.facts, mission=mission)
    write_replay(replace(high.log, facts=facts, wind_mps=wind_mps), {"seed": 5}, windy)
    training = path.with_name("training.rrd")
    curve = TrainingCurve(
        title="cost",
        digits=1,
        decisions=np.array([0.0, 1.0]),
        cost=np.array([9.0, 8.0]),
        sem=np.array([1.0, 1.0]),
        references={"tdma": 7.0},
    )
    with new_recording(two_way.log, curve) as recording:
        recording.save(training)
        out = RerunLog([recording], two_way.log)
        draw_training_curve(out, curve)
        send_layout(recording, out, is_live=True, curve=curve)
    return replay, flood_replay, blocked_replay, path, windy, training


@pytest.fixture(scope="module")
def found(written):
    """The paths of all that any of them has."""
    return {entity.removeprefix("/") for path in written for entity in entities(path)}


def test_paths_are_layers_own_and_below_a_view():
    """Two names of one layer, as by its fate, are one."""
    its = set(declared(ReplayLayer).values())
    paths = [layer.path for layer in its]
    assert len(set(paths)) == len(paths)
    views = tuple(f"{view.path}/" for view in declared(View).values())
    for path in paths:
        place = where_text(layers.__file__, f'path="{path}"')
        assert path.startswith(views), f"{place}: {path} is below none of the views"


def test_every_layer_is_drawn_by_some_mission_and_nothing_else(found):
    paths = {layer.path for layer in declared(ReplayLayer).values()}
    # Links between others are drawn as the observer's.
    paths |= {
        of_others(each).path for each in (*layers.LINKS.values(), *layers.SCENE_LINKS.values())
    }
    solids = {layers.SCENE_CUT_OFF.path}
    texts = {layers.LEARNING.below(name).path for name in ("names", "ticks")}
    assert {path for path in found if path.startswith(DRAWN)} - solids - texts == paths


def test_every_entity_that_is_declared_is_written(found):
    # A view's own entity may be empty.
    named = {each.path for each in declared(Entity).values() if not isinstance(each, View)}
    assert named <= found


def shown(path):
    """What the views of a replay's layout show, as beginnings of paths."""
    (layout,) = RrdReader(path).blueprints()
    origins, queries = {}, {}
    for chunk in RrdReader(path).stream(store=layout):
        batch = chunk.to_record_batch()
        for said, field in (
            (origins, "ViewBlueprint:space_origin"),
            (queries, "ViewContents:query"),
        ):
            if field in batch.schema.names:
                view = chunk.entity_path.split("/")[2]
                said[view] = batch.column(field).to_pylist()[0]
    for view, (origin,) in origins.items():
        for query in queries[view]:
            yield query.replace("$origin", origin).lstrip("+ /")


def test_every_layer_is_laid_out(written):
    contents = {each for path in written for each in shown(path)}
    everything = tuple(each.removesuffix("**") for each in contents if each.endswith("/**"))
    for name, layer in declared(ReplayLayer).items():
        assert layer.path.startswith(everything), name
    assert layers.AGES.path in contents


def test_packets_of_each_fate_have_one_layer_on_the_map_and_one_in_the_scene():
    on_map = [*layers.PACKET_LINES, *layers.PACKET_ARROWS]
    assert sorted(on_map) == sorted(PACKETS)
    assert list(layers.PACKET_ARCS) == list(PACKETS)
    for fate, layer in (layers.PACKET_LINES | layers.PACKET_ARROWS).items():
        assert layer.path == f"arena/radio/{fate}"


def test_the_ground_lies_below_beliefs_these_below_packets_and_these_below_robots():
    def orders(*beginnings):
        flat = declared(FlatLayer).values()
        return [x.order for x in flat if x.path.startswith(beginnings) and x != layers.RANGE]

    ground = orders("arena/area", "arena/trail", "arena/world/filling", "arena/world/obs")
    links = orders("arena/world/unbelieved", "arena/world/too_weak")
    beliefs, packets = orders("arena/belief", "arena/tree"), orders("arena/radio")
    for below, above in ((ground, links), (links, beliefs), (beliefs, packets)):
        assert max(below) < min(above)
    assert layers.CUT_OFF.order < layers.TRANSMITTERS.order
    assert max(packets) < layers.ROBOTS.order < layers.EGO.order
