"""What ns-3, the network simulator, says of our radio's scenes: asked anew, or recorded.

    make reference                                   # asks ns-3 again, compares with the recording
    make reference ARGS=--record                     # records anew

Each set of scenes has a mission, whose radio ns-3 is given by its numbers; ns-3 then says who
decodes whom, and at what power. `tests/training/test_ns3.py` replays the recording through our own
channels. ns-3 comes as a wheel with headers and libraries: `ns3_decides.cc` is compiled against it,
which takes seconds and needs g++; its Python interface, which takes half an hour, is not used.
"""

import math
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import swarm_mj
from swarm_mj.cli import script
from swarm_mj.mission import Mission, paper, reference
from swarm_mj.radio.free_space import path_loss_db
from swarm_mj.radio.mission_radio import radio_of
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
            changed += moved_apart(program, Path(folder))
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
    radio, mission = radio_of(scenes.mission), scenes.mission
    position_m, recipient = drawn(scenes, np.random.default_rng(seed))
    is_sender = recipient != np.arange(mission.num_robots)
    power_mw = radio.power_mw * from_db(ROUNDED_DB - UNROUNDED_DB)
    numbers = (power_mw / 1e3, radio.noise_mw / 1e3, radio.threshold, radio.frequency_hz)
    fades = int(mission.fading == "rayleigh")
    lines = [f"radio {' '.join(map(repr, numbers))} {fades} {scenes.law}"]
    for places, sends in zip(position_m, is_sender, strict=True):
        words = [len(sends), *sends.astype(int).tolist(), *places.ravel().tolist()]
        lines.append(f"scene {' '.join(map(repr, words))}")
    rows = np.array(said_by(program, lines))
    decodes, decodes_if_silent, received_mw = np.zeros((3, *is_sender.shape, mission.num_robots))
    decodes[is_sender], decodes_if_silent[is_sender], received_mw[is_sender] = (
        rows[0::3],
        rows[1::3],
        rows[2::3],
    )
    return {
        "position_m": position_m,
        "recipient": recipient,
        "decodes": decodes.astype(np.bool_),  # [k, i, j]: j decodes i
        "decodes_if_silent": decodes_if_silent.astype(np.bool_),  # so, if j did not send itself
        "received_mw": received_mw,  # of i at j; 0 of those that do not send
        "radio": np.array(numbers),  # power [W], noise [W], threshold [1], frequency [Hz]
        "law": np.array(scenes.law),
        "made_by": np.array(f"ns-3 {VERSION}: make reference ARGS=--record"),
    }


def moved_apart(program: Path, folder: Path) -> int:
    """Return where and when a trace of `tools/mobility.py` is off by a millimetre in ns-3."""
    replay, trace, table = (folder / f"walk.{suffix}" for suffix in ("rrd", "tcl", "csv"))
    swarm_mj.fly("random-walk", policy="tdma", num_robots=10, num_windows=200).save(replay)
    for out in (trace, table):
        tool = [sys.executable, str(ROOT / "tools" / "mobility.py"), str(replay)]
        subprocess.run([*tool, "--out", str(out)], check=True, capture_output=True)
    expected = np.loadtxt(table, delimiter=",", skiprows=1).reshape(-1, 10, 4)
    times = " ".join(map(repr, expected[:, 0, 0].tolist()))
    found_m = np.array(said_by(program, [f"moves {trace} 10 {times}"])).reshape(-1, 10, 2)
    off_m = np.linalg.norm(found_m - expected[..., 2:], axis=2)
    print(f"mobility: {off_m.size} places, off by {1e3 * off_m.max():.2g} mm at most")
    return int(np.sum(off_m > 1e-3))


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
    position_m = rng.uniform(-half_m, half_m, (*shape, 2))
    recipient = np.tile(np.arange(num_robots), (scenes.num_scenes, 1))
    for row in recipient:
        senders = rng.choice(num_robots, rng.integers(1, MOST_SENDERS + 1), replace=False)
        row[senders] = EVERYONE
        if mission.half_duplex == "eavesdroppers":  # which needs packets that are addressed
            row[senders] = (senders + rng.integers(1, num_robots, len(senders))) % num_robots
            row[senders[:-1]] = senders[1:]  # and robots that send while they are addressed
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
