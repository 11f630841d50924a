"""Replays as MCAP recordings: Foxglove's scene and transforms, and positions, packets and ages.

Foxglove's own messages are protobufs by its published schemas (`foxglove.SceneUpdate`,
`foxglove.FrameTransforms`). What they have no place for are JSON messages, whose schemas stand
here. Times are the mission's, which begins at 0.
"""

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW
from swarm_mj.replay import palette
from swarm_mj.replay.export.flown import FlownWindows, PacketFate, SentPacket, number
from swarm_mj.replay.palette import Colour

WORLD = "world"  # the frame that all others are in
RADIUS_SHARE = 0.02  # of a robot, by half the shown ground's width
UPRIGHT = Quaternion(w=1.0)
NS_PER_S = 1_000_000_000

# The colours of packets, as replays have them.
COLOURS: dict[PacketFate, Colour] = {
    "delivered": palette.DELIVERED,
    "lost": palette.LOST,
    "answered": palette.ANSWERED,
    "unanswered": palette.dim(palette.ANSWERED, 0.6),
    "heard": palette.BROADCAST,
    "unheard": palette.BROADCAST,  # nobody to draw a line to
}

WHOLE: Mapping[str, Any] = {"type": "integer"}
NUMBER: Mapping[str, Any] = {"type": "number"}
SOME_NUMBER: Mapping[str, Any] = {"type": ["number", "null"]}


def _list_of(kind: Mapping[str, Any], about: str) -> Mapping[str, Any]:
    return {"type": "array", "items": kind, "description": about}


def _about(kind: Mapping[str, Any], about: str) -> Mapping[str, Any]:
    return {**kind, "description": about}


# The schemas of our own messages, by their topics.
SCHEMAS: dict[str, Mapping[str, Mapping[str, Any]]] = {
    "/positions": {
        "window": _about(WHOLE, "1 is the mission's first"),
        "x_m": _list_of(NUMBER, "of each robot, from the window's beginning on [m]"),
        "y_m": _list_of(NUMBER, "likewise"),
        "vx_mps": _list_of(SOME_NUMBER, "the way since the window before over its time [m/s]"),
        "vy_mps": _list_of(SOME_NUMBER, "likewise"),
        "is_on": _list_of({"type": "boolean"}, "whether each robot has not failed"),
    },
    "/packets": {
        "window": _about(WHOLE, "1 is the mission's first"),
        "slot": _about(WHOLE, "0 or 1, of the window"),
        "sender": _about(WHOLE, "the robot that sent it"),
        "recipient": _about({"type": ["integer", "null"]}, "the robot addressed; null: everyone"),
        "fate": _about({"type": "string", "enum": list(COLOURS)}, "what became of it"),
        "receivers": _list_of(WHOLE, "the robots that decoded it"),
    },
    "/ages": {
        "window": _about(WHOLE, "1 is the mission's first; ages are those at its end"),
        "aoi": _about(SOME_NUMBER, "age of information, mean over all pairs of robots [windows]"),
        "aoi_std": _about(SOME_NUMBER, "its standard deviation over the pairs [windows]"),
        "aoi_worst": _about(SOME_NUMBER, "the worst pair's [windows]"),
        "observer": _about(WHOLE, "the robot whose knowledge follows"),
        "known": _list_of(SOME_NUMBER, "age of what it knows about each robot; null: nothing"),
    },
}
# What is added of robots with bodies.
UPWARD: dict[str, Mapping[str, Mapping[str, Any]]] = {
    "/positions": {
        "z_m": _list_of(NUMBER, "height of each robot above the floor [m]"),
        "vz_mps": _list_of(SOME_NUMBER, "upwards, as vx_mps [m/s]"),
    }
}


def recording(flown: FlownWindows, advance: Callable[[], None]) -> bytes:
    """Return the recording of a flight as the content of an MCAP file."""
    stream = io.BytesIO()
    out = _Recording(stream, has_bodies=flown.has_bodies)
    facts = flown.footage.facts
    about = {"policy": facts.policy, "seed": facts.seed, "observer": facts.observer}
    out.describe("flight", about)
    out.describe("mission", asdict(facts.mission))
    for row in range(len(flown.footage.window)):
        _record_window(out, flown, row)
        advance()
    out.finish()
    return stream.getvalue()


class _Recording:
    """An MCAP file that is being written: a channel for each topic, as topics come up."""

    def __init__(self, stream: io.BytesIO, *, has_bodies: bool) -> None:
        self._has_bodies = has_bodies
        self._writer = Writer(stream)
        self._writer.start(library="swarm-mj")
        self._channels: dict[str, int] = {}

    def describe(self, name: str, facts: Mapping[str, object]) -> None:
        """Write metadata: texts by their names."""
        self._writer.add_metadata(name, {key: str(value) for key, value in facts.items()})

    def protobuf(self, topic: str, message: Message, at_s: float) -> None:
        """Write a message of Foxglove's."""
        if topic not in self._channels:
            schema = register_schema(self._writer, type(message))
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        self._add(topic, message.SerializeToString(), at_s)

    def json(self, topic: str, message: Mapping[str, object], at_s: float) -> None:
        """Write a message of our own, which `SCHEMAS`, and of bodies `UPWARD`, describe."""
        if topic not in self._channels:
            properties = dict(SCHEMAS[topic])
            if self._has_bodies:
                properties.update(UPWARD.get(topic, {}))
            document = {"type": "object", "properties": properties, "required": list(properties)}
            schema = self._writer.register_schema(
                name=f"swarm_mj.{topic[1:].title()}",
                encoding="jsonschema",
                data=json.dumps(document).encode(),
            )
            self._channels[topic] = self._writer.register_channel(topic, "json", schema)
        self._add(topic, json.dumps(message, allow_nan=False).encode(), at_s)

    def _add(self, topic: str, data: bytes, at_s: float) -> None:
        at_ns = round(at_s * NS_PER_S)
        self._writer.add_message(
            channel_id=self._channels[topic], log_time=at_ns, publish_time=at_ns, data=data
        )

    def finish(self) -> None:
        """Write the end of the file."""
        self._writer.finish()


def _record_window(out: _Recording, flown: FlownWindows, row: int) -> None:
    window = int(flown.footage.window[row])
    begin_s = flown.begin_s(row)
    out.protobuf("/tf", _transforms(flown, row), begin_s)
    out.json("/positions", {"window": window, **_positions(flown, row)}, begin_s)
    packets = list(flown.packets(row))
    for slot in range(SLOTS_PER_WINDOW):
        at_s = flown.begin_s(row, slot)
        of_slot = [packet for packet in packets if packet.slot == slot]
        entities = [_packet_lines(flown, row, of_slot, at_s)]
        if slot == 0:
            entities.append(_bodies(flown, row))
        out.protobuf("/scene", SceneUpdate(entities=entities), at_s)
        for packet in of_slot:
            message = {
                "window": window,
                "slot": packet.slot,
                "sender": packet.sender,
                "recipient": packet.recipient,
                "fate": packet.fate,
                "receivers": packet.receivers,
            }
            out.json("/packets", message, at_s)
    ages = flown.ages(row)
    message = {
        "window": window,
        "aoi": ages.mean,
        "aoi_std": ages.std,
        "aoi_worst": ages.worst,
        "observer": flown.footage.ego,
        "known": ages.known,
    }
    out.json("/ages", message, flown.end_s(row))


def _timestamp(at_s: float) -> Timestamp:
    seconds, nanos = divmod(round(at_s * NS_PER_S), NS_PER_S)
    return Timestamp(seconds=seconds, nanos=nanos)


def _transforms(flown: FlownWindows, row: int) -> FrameTransforms:
    """Return the frame of each robot, r0 and so on, in the world's."""
    at = _timestamp(flown.begin_s(row))
    turns = _turns(flown, row)
    transforms: list[FrameTransform] = []
    for robot, (x_m, y_m, z_m) in enumerate(flown.place_m[row].tolist()):
        transforms.append(
            FrameTransform(
                timestamp=at,
                parent_frame_id=WORLD,
                child_frame_id=f"r{robot}",
                translation=Vector3(x=x_m, y=y_m, z=z_m),
                rotation=turns[robot],
            )
        )
    return FrameTransforms(transforms=transforms)


def _turns(flown: FlownWindows, row: int) -> list[Quaternion]:
    """Return how each robot is turned; points are upright."""
    attitude = flown.footage.attitude
    if attitude is None:
        return [UPRIGHT] * flown.num_robots
    return [Quaternion(w=w, x=x, y=y, z=z) for w, x, y, z in attitude[row].tolist()]


def _positions(flown: FlownWindows, row: int) -> dict[str, object]:
    x_m, y_m, z_m = flown.place_m[row].T
    vx_mps, vy_mps, vz_mps = flown.velocity_mps(row).T
    positions: dict[str, object] = {
        "x_m": _numbers(x_m),
        "y_m": _numbers(y_m),
        "vx_mps": _numbers(vx_mps),
        "vy_mps": _numbers(vy_mps),
        "is_on": flown.footage.is_on[row].tolist(),
    }
    if flown.has_bodies:
        positions["z_m"] = _numbers(z_m)
        positions["vz_mps"] = _numbers(vz_mps)
    return positions


def _numbers(values: Sequence[float] | np.ndarray) -> list[float | None]:
    return [number(value) for value in values]


def _bodies(flown: FlownWindows, row: int) -> SceneEntity:
    """Return the robots, coloured by the age of what the observer knows about them."""
    footage = flown.footage
    radius_m = RADIUS_SHARE * footage.ground.reach_m
    size = Vector3(x=2.0 * radius_m, y=2.0 * radius_m, z=radius_m)
    cylinders: list[CylinderPrimitive] = []
    places_m = flown.place_m[row].tolist()
    up_m = 0.0 if flown.has_bodies else 0.5 * radius_m  # points lie on the floor
    colours = footage.colours[row].tolist()
    for (x_m, y_m, z_m), turn, colour in zip(places_m, _turns(flown, row), colours, strict=True):
        place = Vector3(x=x_m, y=y_m, z=z_m + up_m)
        cylinders.append(
            CylinderPrimitive(
                pose=Pose(position=place, orientation=turn),
                size=size,
                bottom_scale=1.0,
                top_scale=1.0,
                color=_color(colour),
            )
        )
    return SceneEntity(
        timestamp=_timestamp(flown.begin_s(row)),
        frame_id=WORLD,
        id="robots",
        cylinders=cylinders,
    )


def _packet_lines(
    flown: FlownWindows, row: int, packets: Sequence[SentPacket], at_s: float
) -> SceneEntity:
    """Return the packets of one slot as lines; each update replaces those of the slot before."""
    above_m = RADIUS_SHARE * flown.footage.ground.reach_m  # its robots' places
    points: list[Point3] = []
    colours: list[Color] = []
    for packet in packets:
        colour = _color(COLOURS[packet.fate])
        for start_m, end_m in _ways(flown.place_m[row], packet):
            for x_m, y_m, z_m in (start_m, end_m):
                points.append(Point3(x=x_m, y=y_m, z=z_m + above_m))
                colours.append(colour)
    lines: list[LinePrimitive] = []
    if points:
        lines.append(
            LinePrimitive(
                type=LinePrimitive.LINE_LIST,
                pose=Pose(orientation=UPRIGHT),
                thickness=2.0,
                scale_invariant=True,
                points=points,
                colors=colours,
            )
        )
    return SceneEntity(timestamp=_timestamp(at_s), frame_id=WORLD, id="packets", lines=lines)


def _ways(place_m: np.ndarray, packet: SentPacket) -> Iterator[tuple[list[float], list[float]]]:
    """Yield the lines of a packet: to its recipient, or to all that decoded a broadcast."""
    start_m = place_m[packet.sender]
    ends = packet.receivers
    share = 1.0
    if packet.fate not in ("heard", "unheard") and packet.recipient is not None:
        ends = [packet.recipient]
        if packet.fate in ("lost", "unanswered"):  # it stops short of the recipient
            share = palette.LOST_SHARE
    for end in ends:
        yield start_m.tolist(), (start_m + share * (place_m[end] - start_m)).tolist()


def _color(colour: Sequence[int]) -> Color:
    red, green, blue = colour
    return Color(r=red / 255.0, g=green / 255.0, b=blue / 255.0, a=1.0)
