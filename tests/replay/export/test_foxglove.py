"""MCAP recordings, opened by MCAP's own reader and decoded by their own schemas."""

import io
import json

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from swarm_mj.replay import palette
from swarm_mj.replay.export.foxglove import recording


@pytest.fixture(scope="module")
def content(requests):
    return recording(requests, lambda: None)


@pytest.fixture(scope="module")
def flown_high(bodies):
    return recording(bodies, lambda: None)


def read(content, topic):
    """The messages of a topic, each with its time [s]."""
    reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()])
    for schema, _, message in reader.iter_messages(topics=[topic]):
        at_s = message.log_time / 1e9
        if schema.encoding == "jsonschema":
            document = json.loads(message.data)
            jsonschema.validate(document, json.loads(schema.data))
            yield at_s, document
        else:
            yield at_s, DecoderFactory().decoder_for("protobuf", schema)(message.data)


def test_topics_have_foxglove_s_schemas_or_ours(content):
    summary = make_reader(io.BytesIO(content)).get_summary()
    channels = summary.channels.values()
    schemas = summary.schemas
    assert {
        channel.topic: (schemas[channel.schema_id].name, channel.message_encoding)
        for channel in channels
    } == {
        "/tf": ("foxglove.FrameTransforms", "protobuf"),
        "/scene": ("foxglove.SceneUpdate", "protobuf"),
        "/positions": ("swarm_mj.Positions", "json"),
        "/packets": ("swarm_mj.Packets", "json"),
        "/ages": ("swarm_mj.Ages", "json"),
    }
    assert summary.statistics.message_start_time == 0
    assert summary.statistics.message_end_time == 3_000_000_000  # 30 windows of 100 ms


def test_messages_are_in_the_order_of_time(content):
    times = [m.log_time for *_, m in make_reader(io.BytesIO(content)).iter_messages()]
    in_file = [
        m.log_time for *_, m in make_reader(io.BytesIO(content)).iter_messages(log_time_order=False)
    ]
    assert in_file == times


def test_transforms_and_positions_are_where_the_robots_were(content, two_way):
    log = two_way.log
    for k, (at_s, message) in enumerate(read(content, "/tf")):
        assert at_s == pytest.approx(0.1 * k)
        names = [each.child_frame_id for each in message.transforms]
        assert names == [f"r{i}" for i in range(12)]
        found_m = [(each.translation.x, each.translation.y) for each in message.transforms]
        np.testing.assert_allclose(found_m, log.position_m[k], atol=1e-4)
    positions = list(read(content, "/positions"))
    assert len(positions) == 30
    assert positions[0][1]["vx_mps"] == [None] * 12
    for k, (_, message) in enumerate(positions):
        assert message["window"] == k + 1
        np.testing.assert_allclose(message["x_m"], log.position_m[k, :, 0], atol=1e-4)
        np.testing.assert_allclose(message["y_m"], log.position_m[k, :, 1], atol=1e-4)
        assert message["is_on"] == [True] * 12


def test_points_are_upright_on_the_ground_and_have_no_heights(content):
    for _, message in read(content, "/tf"):
        for each in message.transforms:
            assert each.translation.z == 0.0
            turn = each.rotation
            assert (turn.w, turn.x, turn.y, turn.z) == (1.0, 0.0, 0.0, 0.0)
    for _, message in read(content, "/positions"):
        assert list(message) == ["window", "x_m", "y_m", "vx_mps", "vy_mps", "is_on"]


def test_bodies_are_at_their_heights_and_turned_as_they_were(flown_high, high):
    """MuJoCo's quaternions begin with the real part."""
    log = high.log
    num_tilted = 0
    for k, (_, message) in enumerate(read(flown_high, "/tf")):
        found_m = [each.translation.z for each in message.transforms]
        np.testing.assert_allclose(found_m, log.height_m[k], atol=1e-4)
        turns = [each.rotation for each in message.transforms]
        found = [(turn.w, turn.x, turn.y, turn.z) for turn in turns]
        np.testing.assert_allclose(found, log.attitude[k], atol=1e-5)
        num_tilted += sum(turn.w < 0.9999 for turn in turns)
    assert num_tilted > 0


def test_positions_of_bodies_have_heights_and_a_schema_that_says_so(climbing):
    """They climb 0.2 m in each window of 0.1 s."""
    content = recording(climbing, lambda: None)
    start_m = climbing.footage.height_m[0]
    for k, (_, message) in enumerate(read(content, "/positions")):
        assert list(message)[-2:] == ["z_m", "vz_mps"]
        np.testing.assert_allclose(message["z_m"], start_m + 0.2 * k, atol=1e-5)
        if k > 0:
            np.testing.assert_allclose(message["vz_mps"], 2.0, atol=1e-6)
    (schema,) = (
        json.loads(each.data)
        for each in make_reader(io.BytesIO(content)).get_summary().schemas.values()
        if each.name == "swarm_mj.Positions"
    )
    assert schema["required"][-2:] == ["z_m", "vz_mps"]


def test_discs_and_lines_of_bodies_are_at_their_heights(flown_high, bodies):
    """Lines are a little above, by the height of a disc."""
    above_m = 0.02 * bodies.footage.ground.reach_m
    num_lines = 0
    for number, (_, message) in enumerate(read(flown_high, "/scene")):
        k, slot = divmod(number, 2)
        height_m = bodies.place_m[k, :, 2]
        sent = [packet for packet in bodies.packets(k) if packet.slot == slot]
        for entity in message.entities:
            if entity.id == "robots":
                found_m = [each.pose.position.z for each in entity.cylinders]
                np.testing.assert_allclose(found_m, height_m, atol=1e-9)
                turns = [each.pose.orientation.w for each in entity.cylinders]
                np.testing.assert_allclose(turns, bodies.footage.attitude[k, :, 0], atol=1e-9)
            for line in entity.lines:
                starts_m = [point.z for point in line.points[::2]]
                senders = [packet.sender for packet in sent]
                np.testing.assert_allclose(starts_m, height_m[senders] + above_m, atol=1e-9)
                num_lines += len(starts_m)
    assert num_lines > 0


def test_packets_are_those_of_the_flight(content, requests):
    found = list(read(content, "/packets"))
    expected = []
    for k in range(30):
        for packet in requests.packets(k):
            its = packet._asdict()
            expected.append((its.pop("begin_s"), {"window": k + 1, **its}))
    assert found == expected


def test_ages_are_those_at_the_end_of_windows(content, two_way):
    for k, (at_s, message) in enumerate(read(content, "/ages")):
        assert at_s == pytest.approx(0.1 * (k + 1))
        assert message["aoi"] == pytest.approx(two_way.log.age_mean[k], abs=1e-6)
        assert message["observer"] == 4
        known = np.array(message["known"], dtype=float)
        np.testing.assert_allclose(known, two_way.log.known_age[k], atol=1e-6)


def rgb(colour):
    return tuple(round(255.0 * share) for share in (colour.r, colour.g, colour.b))


def test_the_scene_has_robots_in_the_replay_s_colours(content, two_way):
    updates = list(read(content, "/scene"))
    assert len(updates) == 60  # one a slot
    for k, (at_s, message) in enumerate(updates[::2]):
        assert at_s == pytest.approx(0.1 * k)
        (bodies,) = (each for each in message.entities if each.id == "robots")
        colours = [rgb(each.color) for each in bodies.cylinders]
        assert colours == list(map(tuple, two_way.log.colours[k].tolist()))
        found_m = [(each.pose.position.x, each.pose.position.y) for each in bodies.cylinders]
        np.testing.assert_allclose(found_m, two_way.log.position_m[k], atol=1e-4)


def test_the_scene_has_the_lines_of_one_slot_s_packets(content, requests):
    colours = {"delivered": palette.DELIVERED, "lost": palette.LOST, "answered": palette.ANSWERED}
    seen = set()
    for number, (at_s, message) in enumerate(read(content, "/scene")):
        k, slot = divmod(number, 2)
        assert at_s == pytest.approx(0.05 * number)
        (entity,) = (each for each in message.entities if each.id == "packets")
        sent = [packet for packet in requests.packets(k) if packet.slot == slot]
        if not sent:  # an entity without lines takes those of the slot before away
            assert not entity.lines
            continue
        (line,) = entity.lines
        points_m = np.array([(each.x, each.y) for each in line.points]).reshape(-1, 2, 2)
        place_m = requests.footage.position_m[k]
        for packet, (start_m, end_m), colour in zip(sent, points_m, line.colors[::2], strict=True):
            np.testing.assert_allclose(start_m, place_m[packet.sender], atol=1e-9)
            seen.add(packet.fate)
            if packet.fate in colours:
                assert rgb(colour) == colours[packet.fate]
            way_m = place_m[packet.recipient] - start_m
            share = 0.6 if packet.fate in ("lost", "unanswered") else 1.0
            np.testing.assert_allclose(end_m, start_m + share * way_m, atol=1e-9)
    assert {"delivered", "lost", "answered"} <= seen


def test_lines_of_broadcasts_lead_to_all_who_heard_them(broadcasts):
    updates = read(recording(broadcasts, lambda: None), "/scene")
    num_lines = 0
    for _, message in updates:
        for entity in message.entities:
            num_lines += sum(len(line.points) // 2 for line in entity.lines)
    receptions = sum(len(packet.receivers) for k in range(30) for packet in broadcasts.packets(k))
    assert num_lines == receptions > 0


def test_the_file_says_which_flight_it_is(content):
    facts = {each.name: each.metadata for each in make_reader(io.BytesIO(content)).iter_metadata()}
    assert facts["flight"] == {"policy": "mst", "seed": "5", "observer": "4"}
    assert facts["mission"]["num_robots"] == "12"
    assert facts["mission"]["window_s"] == "0.1"


def test_each_window_is_counted(requests):
    done = []
    recording(requests, lambda: done.append(1))
    assert len(done) == 30
