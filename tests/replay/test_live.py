"""A flight that is shown in pieces has the rows of the one that is drawn whole."""

from collections import defaultdict

import numpy as np
import pytest
from rerun.chunk import RrdReader

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay import live
from swarm_mj.replay.live import LiveReplay
from swarm_mj.replay.read import check_replay, read_footage
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.write import write_replay
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

CITY = {"arena": "blocks", "shadowing_db": 6.0, "velocity_ratio": 0.6}
FLIGHTS = {
    "addressed": ("mst", "flocking", {"boundary": "reflect"}),
    "broadcast": ("tdma", "flocking", {}),  # it agrees, in an open area
    "at rest": ("mst", "stationary", {}),
    "among obstacles": ("random-flooding", "random-walk", CITY),
    "with failures": ("tdma", "random-walk", {"failure_fraction": 0.3}),
}
CONFIG = {"policy": "a policy", "seed": 3, "packet_bytes": 100, "window_s": 0.1}


def flown(name, on_window=None, *, num_windows=90):
    """A recorder, and what `on_window` makes of it, called after every window."""
    policy, task, its = FLIGHTS[name]
    mission = paper(task, num_robots=9, num_windows=num_windows, **its)
    swarm = Swarm(mission, [3])
    swarm.start(make_policy(policy, mission))
    record = Recorder(swarm, ego=2)
    shown = on_window(record) if on_window else None
    for window in rollout(swarm):
        record.add(window)
        if shown:
            shown.show()
    return record, shown


@pytest.fixture
def nowhere(monkeypatch):
    """A viewer's address, to which nothing is sent."""
    monkeypatch.setattr(live.rr.RecordingStream, "connect_grpc", lambda *_: None)
    monkeypatch.setattr(live, "BETWEEN_PIECES_S", 0.0)
    return "rerun+http://127.0.0.1:9/proxy"


def rows(path):
    """By entity and component, the value of each window; of what never changes, the last."""
    found = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if ":" in name or name in ("age", "is_on")]
        entity = chunk.entity_path
        if entity.startswith("/__properties"):
            continue
        for name in names:
            windows = [None] * batch.num_rows if chunk.is_static else batch["window"].to_pylist()
            for window, value in zip(windows, batch[name].to_pylist(), strict=True):
                found[entity, name].append((window, value))
    return {key: sorted(each, key=lambda row: row[0] or 0) for key, each in found.items()}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_shown_in_pieces_has_the_rows_of_the_whole_one(name, nowhere, tmp_path):
    def shows(record):
        return LiveReplay(record, CONFIG, "a", nowhere, has_file=True)

    record, shown = flown(name, shows)
    assert shown._num_drawn == 75  # three pieces of four, the last of which is not full
    shown.finish()
    shown.save(tmp_path / "pieces.rrd")
    check_replay(tmp_path / "pieces.rrd")
    write_replay(record.log(CONFIG), CONFIG, tmp_path / "a.rrd")
    pieces, whole = rows(tmp_path / "pieces.rrd"), rows(tmp_path / "a.rrd")
    assert pieces.keys() == whole.keys()
    for key, expected in whole.items():
        assert repr(pieces[key]) == repr(expected), key  # nan is not equal to itself
    seen, expected = (read_footage(tmp_path / f"{each}.rrd") for each in ("pieces", "a"))
    assert seen.facts == expected.facts
    np.testing.assert_array_equal(seen.position_m, expected.position_m)
