"""What ns-3, the network simulator, says of our radio's scenes: asked anew, or recorded.

    make reference                                   # asks ns-3 again, compares with the recording
    make reference ARGS=--record                     # records anew

Each set of scenes has a mission, whose radio ns-3 is given by its numbers; ns-3 then says who
decodes whom, and at what power. `tests/training/test_ns3.py` replays the recording through our own
channels. Flights are handed over as `swarm-mj export --to ns2` writes them: ns-3 moves its robots
by the trace, lets those send that the table says, and must find the receivers of the table. ns-3
comes as a wheel with headers and libraries: `ns3_decides.cc` is compiled against it, which takes
seconds and needs g++; its Python interface, which takes half an hour, is not used.
"""

import csv
import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import swarm_mj
from swarm_mj.cli import script
from swarm_mj.mission import Mission, paper, reference
from swarm_mj.mission.geometry import PLANE, SPACE
from swarm_mj.radio.free_space import path_loss_db
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.replay.export.formats import files_of
from swarm_mj.replay.read import read_flown
from swarm_mj.system.decibels import from_db
from swarm_mj.system.fields import setting

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
GOLDEN = ROOT / "tests" / "golden" / "ns3"
VERSION = "3.44"
LIBRARIES = ("spectrum", "propagation", "antenna", "mobility", "network", "stats", "core")
# The constant of Eq. 1 with the speed of light that ns-3 has; the paper rounds it to 147.55. So
# ns-3 is given a power that is as much lower, 0.0022 dB, or it would decode what we just do not.
UNROUNDED_DB = 20.0 * math.log10(299_792_458.0 / (4.0 * math.pi))
ROUNDED_DB = -path_loss_db(1.0, 1.0)
EVERYONE = -1  # a recipient: who hears it, decodes it
MOST_SENDERS = 7

Arrays = dict[str, np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Scenes:
    """A set of scenes: whose radio they are of, and how ns-3 calls its path loss."""

    mission: Mission
    law: str = "free-space"  # as `ns3_decides.cc` reads it
    num_scenes: int = 40
    is_repeated: bool = False  # one scene over and over: what differs are its fades


SETS = {
    "free-space": Scenes(mission=paper("stationary", num_robots=20)),
    "authors": Scenes(mission=reference("stationary", num_robots=20), num_scenes=80),
    # Free space up to 20 m, then 30 dB per decade: the defaults of --path-loss log-distance.
    "log-distance": Scenes(
        mission=paper("stationary", num_robots=20, path_loss="log-distance", range_ratio=0.5),
        law="log-distance 20 3",
    ),
    # The slope of --preset urban, which begins at 1 m.
    "street": Scenes(
        mission=paper(
            "stationary",
            num_robots=20,
            path_loss="log-distance",
            loss_exponent=2.1,
            reference_m=1.0,
        ),
        law="log-distance 1 2.1",
    ),
    "two-ray": Scenes(
        mission=paper("stationary", num_robots=20, path_loss="two-ray"), law="two-ray 1"
    ),
    # Below 0 dB a robot could decode several packets of one slot.
    "capture": Scenes(mission=paper("stationary", num_robots=20, sinr_threshold_db=-6.0)),
    "rayleigh": Scenes(
        mission=paper("stationary", num_robots=10, fading="rayleigh"),
        num_scenes=300,
        is_repeated=True,
    ),
    # Robots from 5 to 120 m above the floor; the last set's path loss is that of "street".
    "heights": Scenes(
        mission=paper(
            "stationary", num_robots=20, robot="quadrotor", height_m=5.0, height_range_m=115.0
        ),
    ),
    "heights-street": Scenes(
        mission=paper(
            "stationary",
            num_robots=20,
            robot="quadrotor",
            height_m=5.0,
            height_range_m=115.0,
            path_loss="log-distance",
            loss_exponent=2.1,
            reference_m=1.0,
        ),
        law="log-distance 1 2.1",
    ),
}


# Flights that are exported and flown again in ns-3: their policies, over the radio of these scenes.
FLIGHTS = {
    "broadcasts": (
        "planner",
        Scenes(mission=paper("flocking", num_robots=20, num_windows=200)),
    ),
    "requests": (
        "mst",
        Scenes(mission=paper("random-walk", num_robots=20, num_windows=200)),
    ),
    "authors": (
        "mst",
        Scenes(mission=reference("random-walk", num_robots=20, num_windows=200)),
    ),
    "log-distance": (
        "random-flooding",
        Scenes(
            mission=paper(
                "random-walk",
                num_robots=20,
                num_windows=200,
                path_loss="log-distance",
                range_ratio=0.5,
            ),
            law="log-distance 20 3",
        ),
    ),
    # In ns-3 they stay at their first height, which they leave by centimetres here.
    "heights": (
        "planner",
        Scenes(
            mission=paper(
                "flocking",
                num_robots=20,
                num_windows=200,
                robot="quadrotor",
                height_m=5.0,
                height_range_m=115.0,
            )
        ),
    ),
}


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Where ns-3 is, and whether to record."""

    ns3: Path = setting(
        ROOT / ".venv" / "ns3" / "ns3", "the wheel's folder of that name", shown=".venv/ns3/ns3"
    )
    record: bool = setting(False, "write what ns-3 says, instead of comparing it with what it said")

    def __call__(self) -> int:
        """Ask ns-3; return the exit code, which is 1 if it says anything else than it did."""
        changed = 0
        with tempfile.TemporaryDirectory() as folder:
            program = compiled(self.ns3, Path(folder))
            for seed, (name, scenes) in enumerate(SETS.items()):
                arrays = asked(program, scenes, seed)
                if self.record:
                    GOLDEN.mkdir(parents=True, exist_ok=True)
                    np.savez_compressed(GOLDEN / f"{name}.npz", allow_pickle=False, **arrays)
                changed += differences(name, arrays)
            for name, (policy, scenes) in FLIGHTS.items():
                stem = Path(folder) / name
                exported(scenes.mission, policy, stem)
                changed += flown_apart(program, scenes, stem)
        return 1 if changed else 0


def compiled(ns3: Path, folder: Path) -> Path:
    """Compile the program that asks ns-3; raise ValueError without ns-3 or a compiler."""
    if not (ns3 / "include" / "ns3" / "spectrum-module.h").exists():
        raise ValueError(f"no ns-3 in {ns3}; make reference installs it in .venv/ns3")
    if shutil.which("g++") is None:
        raise ValueError("ns-3 is asked by a program in C++, which needs g++; install g++")
    program = folder / "ns3_decides"
    libraries = [f"-lns{VERSION}-{name}" for name in LIBRARIES]
    places = [f"-I{ns3 / 'include'}", f"-L{ns3 / 'lib64'}", f"-Wl,-rpath,{ns3 / 'lib64'}"]
    source = str(HERE / "ns3_decides.cc")
    command = ["g++", "-std=c++20", "-O1", source, *places, *libraries, "-o", str(program)]
    subprocess.run(command, check=True)
    return program


def asked(program: Path, scenes: Scenes, seed: int) -> Arrays:
    """Draw a set's scenes, hand them to ns-3 and return both."""
    position_m, recipient = drawn(scenes, np.random.default_rng(seed))
    return {
        "position_m": position_m,
        "recipient": recipient,
        **decided(program, scenes, position_m, recipient),
        "radio": np.array(radio_numbers(scenes.mission)),
        "law": np.array(scenes.law),
        "made_by": np.array(f"ns-3 {VERSION}: make reference ARGS=--record"),
    }


def radio_numbers(mission: Mission) -> tuple[float, float, float, float]:
    """Return the radio that ns-3 is given: power [W], noise [W], threshold [1], frequency [Hz]."""
    radio = radio_of(mission)
    power_mw = radio.power_mw * from_db(ROUNDED_DB - UNROUNDED_DB)
    return power_mw / 1e3, radio.noise_mw / 1e3, radio.threshold, radio.frequency_hz


def decided(program: Path, scenes: Scenes, position_m: np.ndarray, recipient: np.ndarray) -> Arrays:
    """Return what ns-3 decides of slots, by the robots' places [k, i, D] and recipients [k, i]."""
    num_robots = scenes.mission.num_robots
    flat = ((0, 0), (0, 0), (0, SPACE - position_m.shape[2]))  # robots in the plane are at height 0
    place_m = np.pad(position_m, flat)
    is_sender = recipient != np.arange(num_robots)
    fades = int(scenes.mission.fading == "rayleigh")
    numbers = " ".join(map(repr, radio_numbers(scenes.mission)))
    lines = [f"radio {numbers} {fades} {scenes.law}"]
    for where_m, sends in zip(place_m, is_sender, strict=True):
        words = [len(sends), *sends.astype(int).tolist(), *where_m.ravel().tolist()]
        lines.append(f"scene {' '.join(map(repr, words))}")
    rows = np.array(said_by(program, lines))
    decodes, decodes_if_silent, received_mw = np.zeros((3, *is_sender.shape, num_robots))
    decodes[is_sender], decodes_if_silent[is_sender], received_mw[is_sender] = (
        rows[0::3],
        rows[1::3],
        rows[2::3],
    )
    return {
        "decodes": decodes.astype(np.bool_),  # [k, i, j]: j decodes i
        "decodes_if_silent": decodes_if_silent.astype(np.bool_),  # so, if j did not send itself
        "received_mw": received_mw,  # of i at j; 0 of those that do not send
    }


def heard(mission: Mission, recipient: np.ndarray, arrays: Arrays) -> np.ndarray:
    """Return the sender that each robot decodes [k, j], by ns-3's decisions and powers.

    Two rules are not ns-3's. Of several packets a robot takes the strongest (III-B); and under the
    authors' half duplex, a packet that is addressed to a robot that sends is decided as if it did
    not. ns-3's radios never decode while they send, so for these ns-3 was asked again without that
    sender. Which packets are such is the authors' rule. A robot's own number is nobody.
    """
    decodes = arrays["decodes"]
    robots = np.arange(decodes.shape[2])
    if mission.recipient_hears_while_sending:
        is_addressed = recipient[:, :, None] == robots
        decodes = decodes | (arrays["decodes_if_silent"] & is_addressed)
    power_mw = np.where(decodes, arrays["received_mw"], 0.0)
    return np.where(power_mw.max(axis=1) > 0.0, power_mw.argmax(axis=1), robots)


def exported(mission: Mission, policy: str, stem: Path) -> None:
    """Fly a mission, and export its replay as `swarm-mj export --to ns2` does."""
    replay = swarm_mj.fly(mission, policy=policy).save(stem.with_name(f"{stem.name}.rrd"))
    flown = read_flown(replay)
    for file, make in files_of("ns2", stem).items():
        file.write_bytes(make(flown, lambda: None))


def flown_apart(program: Path, scenes: Scenes, stem: Path) -> int:
    """Fly an export again in ns-3; return how many packets have other receivers there."""
    num_robots = scenes.mission.num_robots
    with stem.with_name(f"{stem.name}-schedule.csv").open(newline="") as file:
        packets = list(csv.DictReader(file))
    seconds = sorted({float(packet["seconds"]) for packet in packets})
    slots = {at_s: k for k, at_s in enumerate(seconds)}
    recipient = np.tile(np.arange(num_robots), (len(slots), 1))
    for packet in packets:
        slot = slots[float(packet["seconds"])]
        recipient[slot, int(packet["sender"])] = int(packet["recipient"] or EVERYONE)
    position_m = places(program, stem.with_name(f"{stem.name}.tcl"), num_robots, seconds)
    decisions = decided(program, scenes, position_m, recipient)
    found = heard(scenes.mission, recipient, decisions)
    receptions = 0
    apart = 0
    for packet in packets:
        sender = int(packet["sender"])
        is_receiver = found[slots[float(packet["seconds"])]] == sender
        is_receiver[sender] = False
        receivers = list(map(int, packet["receivers"].split()))
        receptions += len(receivers)
        apart += np.flatnonzero(is_receiver).tolist() != receivers
    print(
        f"exported {stem.name}: {len(packets)} packets, {receptions} receptions; "
        f"{apart} packets differ"
    )
    return apart


def places(program: Path, trace: Path, num_robots: int, at_s: Sequence[float]) -> np.ndarray:
    """Return where ns-3 has the robots of a trace at these times [k, i, 3] [m]."""
    times = " ".join(map(repr, at_s))
    said = said_by(program, [f"moves {trace} {num_robots} {times}"])
    return np.array(said).reshape(len(at_s), num_robots, SPACE)


def said_by(program: Path, lines: list[str]) -> list[list[float]]:
    """Return the lines of numbers with which ns-3 answers these."""
    said = subprocess.run(
        [str(program)], input="\n".join(lines), capture_output=True, check=True, encoding="utf-8"
    ).stdout
    return [list(map(float, line.split())) for line in said.splitlines()]


def drawn(scenes: Scenes, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw where robots are and whom each addresses; itself is silence."""
    mission, num_robots = scenes.mission, scenes.mission.num_robots
    shape = scenes.num_scenes, num_robots
    half_m = mission.half_side_m
    position_m = rng.uniform(-half_m, half_m, (*shape, PLANE))
    recipient = np.tile(np.arange(num_robots), (scenes.num_scenes, 1))
    for row in recipient:
        senders = rng.choice(num_robots, rng.integers(1, MOST_SENDERS + 1), replace=False)
        row[senders] = EVERYONE
        if mission.recipient_hears_while_sending:  # which needs packets that are addressed
            row[senders] = (senders + rng.integers(1, num_robots, len(senders))) % num_robots
            row[senders[:-1]] = senders[1:]  # and robots that send while they are addressed
    if mission.has_bodies:
        highest_m = mission.height_m + mission.height_range_m
        height_m = rng.uniform(mission.height_m, highest_m, (*shape, 1))
        position_m = np.concatenate([position_m, height_m], axis=2)
    if scenes.is_repeated:
        position_m[:], recipient[:] = position_m[0], np.arange(num_robots)
        recipient[:, :2] = EVERYONE
    return position_m, recipient


def differences(name: str, arrays: Arrays) -> int:
    """Return in how many numbers the recording differs; say so."""
    with np.load(GOLDEN / f"{name}.npz") as recording:
        is_same = {
            key: np.isclose(value, recording[key], rtol=1e-12, atol=0.0)
            if value.dtype == np.float64
            else np.asarray(value == recording[key])
            for key, value in arrays.items()
        }
    count = sum(int(np.sum(~same)) for same in is_same.values())
    num_senders = int((arrays["recipient"] != np.arange(arrays["recipient"].shape[1])).sum())
    decisions = num_senders * (arrays["recipient"].shape[1] - 1)
    print(
        f"{name}: {decisions} decisions, {arrays['decodes'].sum()} packets decoded; {count} differ"
    )
    return count


if __name__ == "__main__":
    sys.exit(script(Settings, Settings.__call__))
