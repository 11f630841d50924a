"""The flights, results and trainings that `tools/same.py` compares, by their names.

A flight is here because of the code that it runs: each policy on each task, each preset, each
effect of the channel, each part of a user's own. Names stay: the committed digests stand under
them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mujoco._enums import mjtGeom

from swarm_mj import BroadcastPolicy, CentralisedPolicy, DecentralisedPolicy, LocalViews, Policy

NUM_WINDOWS, NUM_ROBOTS = 40, 12  # of a flight, unless it says otherwise


class AskTheStalest(DecentralisedPolicy):
    """Each robot in turn addresses the teammate whose information is oldest."""

    def recipients(self, views: LocalViews) -> np.ndarray:
        """Return a recipient for the robot whose turn it is."""
        stalest = np.argmin(views.buffers.timestamp, axis=2)
        turn = (views.now % views.num_robots)[:, None]
        return np.where(np.arange(views.num_robots) == turn, stalest, views.silence)


class Chatter(BroadcastPolicy):
    """A tenth of the robots transmits, but none right after it decoded a packet."""

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Keep the generator of each mission."""
        self._num_robots, self._rngs = num_robots, rngs

    def transmits(self, views: LocalViews) -> np.ndarray:
        """Return who transmits."""
        wants = np.stack([rng.random(self._num_robots) < 0.1 for rng in self._rngs])
        if not views.phases:
            return wants
        return wants & (views.phases[-1].heard == views.silence)


class Westernmost(CentralisedPolicy):
    """The robot that is farthest west addresses the one that is farthest east."""

    def recipients(self, views: LocalViews, states: Any) -> np.ndarray:  # noqa: ANN401 - its home may move
        """Return a recipient for the westernmost robot."""
        recipient = views.silence.copy()
        for b, place_m in enumerate(states.position_m):
            recipient[b, np.argmin(place_m[:, 0])] = np.argmax(place_m[:, 0])
        return recipient


class Nearest:
    """A channel: each silent robot decodes its nearest sender, unless a draw says otherwise."""

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Keep the generator of each mission."""
        self._num_robots, self._rngs = num_robots, rngs

    def __call__(self, position_m: np.ndarray, recipient: np.ndarray) -> np.ndarray:
        """Return whom each robot decodes."""
        heard = nearest_sender(position_m, recipient)
        lost = np.stack([rng.random(self._num_robots) < 0.2 for rng in self._rngs])
        return np.where(lost, np.arange(self._num_robots), heard)


class EverySecondSlot:
    """A channel that varies: in odd slots nobody decodes anything."""

    def at(self, slot: np.ndarray, mission: np.ndarray) -> Callable[..., np.ndarray]:  # noqa: ARG002
        """Return the channel of these slots."""

        def channel(position_m: np.ndarray, recipient: np.ndarray) -> np.ndarray:
            is_odd = (np.asarray(slot) % 2 == 1)[:, None]
            oneself = np.arange(recipient.shape[1])
            return np.where(is_odd, oneself, nearest_sender(position_m, recipient))

        return channel


def nearest_sender(position_m: np.ndarray, recipient: np.ndarray) -> np.ndarray:
    """Return the nearest sender of each robot that is silent; itself if there is none."""
    heard = np.tile(np.arange(recipient.shape[1]), (len(recipient), 1))
    for b, place_m in enumerate(position_m):
        sends = recipient[b] != np.arange(recipient.shape[1])
        senders = np.flatnonzero(sends)
        if not len(senders):
            continue
        for j in np.flatnonzero(~sends):
            away_m = np.hypot(*(place_m[senders] - place_m[j]).T)
            heard[b, j] = senders[np.argmin(away_m)]
    return heard


class Gather:
    """A controller: each robot moves to the mean of the positions that it knows."""

    cost_name, cost_unit = "spread of the team", "m"

    def __call__(self, buffers: Any, states: Any) -> np.ndarray:  # noqa: ANN401 - their homes may move
        """Return the accelerations [m/s²]."""
        known = buffers.is_known[..., None]
        mean_m = (buffers.position_m * known).sum(axis=2) / np.maximum(1, known.sum(axis=2))
        return 0.1 * (mean_m - states.position_m) - states.velocity_mps

    def cost(self, states: Any) -> np.ndarray:  # noqa: ANN401 - as above
        """Return the standard deviation of the positions [m]."""
        return np.std(states.position_m, axis=1).mean(axis=1)


class Shake:
    """A controller that draws, and costs nothing."""

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Keep the generator of each mission."""
        self._num_robots, self._rngs = num_robots, rngs

    def __call__(self, buffers: Any, states: Any) -> np.ndarray:  # noqa: ANN401, ARG002 - as above
        """Return the accelerations [m/s²]."""
        return np.stack([rng.normal(size=(self._num_robots, 2)) for rng in self._rngs])


class Brake:
    """A controller that stops the robots within a few windows of 100 ms."""

    def __call__(self, buffers: Any, states: Any) -> np.ndarray:  # noqa: ANN401, ARG002 - as above
        """Return the accelerations [m/s²]."""
        return -10.0 * states.velocity_mps


def two_walls(spec: Any, mission: Any) -> None:  # noqa: ANN401 - as above
    """Add a wall that robots hit, and one that attenuates packets, too."""
    size_m = [5.0, 0.3 * mission.side_m, 5.0]
    box = mjtGeom.mjGEOM_BOX
    west_m, east_m = [-0.2 * mission.side_m, 0.0, 5.0], [0.2 * mission.side_m, 0.0, 5.0]
    spec.worldbody.add_geom(name="west wall", type=box, size=size_m, pos=west_m)
    spec.worldbody.add_geom(name="east wall", type=box, size=size_m, pos=east_m, group=1)


ARENA_FILE, GAINS_FILE = "wall.xml", "gains.csv"
WALL = """<mujoco>
  <worldbody>
    <geom name="south" type="box" size="1 120 5" pos="0 -160 5" group="1" user="30"/>
    <geom name="tree" type="cylinder" size="6 5" pos="60 60 5" group="1" user="6"/>
  </worldbody>
</mujoco>
"""


def write_files(folder: Path) -> None:
    """Write the arena and the table of gains that some flights read from the current folder."""
    (folder / ARENA_FILE).write_text(WALL)
    table = "x1_m,y1_m,x2_m,y2_m,gain_db\n"
    for x1_m in (-200, 0, 200):
        for x2_m in (-150, 50, 250):
            gain_db = -70 - abs(x1_m - x2_m) / 10
            table += f"{x1_m},{x2_m / 2},{x2_m},{x1_m / 2},{gain_db}\n"
    (folder / GAINS_FILE).write_text(table)


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Missions side by side: how they are made, and what flies them."""

    policy: str | Callable[[], Policy]
    task: str
    preset: str
    seeds: tuple[int, ...]
    parts: Mapping[str, Any]  # channel, controller, scene: names, or makers of objects
    how: Mapping[str, Any]  # further arguments of `make_policy`
    num_threads: int  # MuJoCo's
    restarts: bool  # whether the missions begin anew after a few windows of others
    fields: Mapping[str, Any]  # of the mission


def flight(
    policy: str | Callable[[], Policy],
    task: str = "random-walk",
    preset: str = "paper",
    *,
    seeds: tuple[int, ...] = (1,),
    channel: str | Callable[[], object] | None = None,
    controller: str | Callable[[], object] | None = None,
    scene: str | None = None,
    how: Mapping[str, Any] | None = None,
    num_threads: int = 1,
    restarts: bool = False,
    **fields: Any,
) -> Flight:
    """Return a flight; what is not said is usual."""
    return Flight(
        policy=policy,
        task=task,
        preset=preset,
        seeds=seeds,
        parts={"channel": channel, "controller": controller, "scene": scene},
        how=how or {},
        num_threads=num_threads,
        restarts=restarts,
        fields={"num_robots": NUM_ROBOTS, "num_windows": NUM_WINDOWS} | fields,
    )


HARSH: dict[str, Any] = {
    "path_loss": "log-distance",
    "loss_exponent": 2.2,
    "shadowing_db": 3.0,
    "fading": "rician",
    "erasure": 0.05,
    "burst_begin": 0.02,
    "high_power_fraction": 0.25,
}
CONTACT: dict[str, Any] = {"physics": "contact", "boundary": "reflect"}
NONE = "planner --payload none"

FLIGHTS: dict[str, Flight] = {
    # Every policy on every task.
    "random-flooding-stationary": flight("random-flooding", "stationary"),
    "random-flooding-random-walk": flight("random-flooding", "random-walk"),
    "random-flooding-flocking": flight("random-flooding", "flocking"),
    "round-robin-stationary": flight("round-robin", "stationary"),
    "round-robin-random-walk": flight("round-robin", "random-walk"),
    "round-robin-flocking": flight("round-robin", "flocking"),
    "mst-stationary": flight("mst", "stationary"),
    "mst-random-walk": flight("mst", "random-walk"),
    "mst-flocking": flight("mst", "flocking"),
    "aloha-stationary": flight("aloha", "stationary"),
    "aloha-random-walk": flight("aloha", "random-walk"),
    "aloha-flocking": flight("aloha", "flocking"),
    "csma-stationary": flight("csma", "stationary"),
    "csma-random-walk": flight("csma", "random-walk"),
    "csma-flocking": flight("csma", "flocking"),
    "age-gain-csma-stationary": flight("age-gain-csma", "stationary"),
    "age-gain-csma-random-walk": flight("age-gain-csma", "random-walk"),
    "age-gain-csma-flocking": flight("age-gain-csma", "flocking"),
    "index-csma-stationary": flight("index-csma", "stationary"),
    "index-csma-random-walk": flight("index-csma", "random-walk"),
    "index-csma-flocking": flight("index-csma", "flocking"),
    "gossip-stationary": flight("gossip", "stationary"),
    "gossip-random-walk": flight("gossip", "random-walk"),
    "gossip-flocking": flight("gossip", "flocking"),
    "tdma-stationary": flight("tdma", "stationary"),
    "tdma-random-walk": flight("tdma", "random-walk"),
    "tdma-flocking": flight("tdma", "flocking"),
    "spatial-tdma-stationary": flight("spatial-tdma", "stationary"),
    "spatial-tdma-random-walk": flight("spatial-tdma", "random-walk"),
    "spatial-tdma-flocking": flight("spatial-tdma", "flocking"),
    "sotdma-stationary": flight("sotdma", "stationary", num_windows=60),
    "sotdma-random-walk": flight("sotdma", "random-walk", num_windows=60),
    "sotdma-flocking": flight("sotdma", "flocking", num_windows=60),
    "planner-stationary": flight("planner", "stationary", num_windows=90),
    "planner-random-walk": flight("planner", "random-walk", num_windows=90),
    "planner-flocking": flight("planner", "flocking", num_windows=90),
    "planner-none-stationary": flight(NONE, "stationary", num_windows=60),
    "planner-none-random-walk": flight(NONE, "random-walk"),
    "planner-none-flocking": flight(NONE, "flocking"),
    "greedy-oracle-stationary": flight("greedy-oracle", "stationary"),
    "greedy-oracle-random-walk": flight("greedy-oracle", "random-walk"),
    "greedy-oracle-flocking": flight("greedy-oracle", "flocking"),
    "lookahead-oracle-stationary": flight("lookahead-oracle", "stationary"),
    "lookahead-oracle-random-walk": flight("lookahead-oracle", "random-walk"),
    "lookahead-oracle-flocking": flight("lookahead-oracle", "flocking"),
    "gnn-stationary": flight("gnn", "stationary"),
    "gnn-random-walk": flight("gnn", "random-walk"),
    "gnn-flocking": flight("gnn", "flocking"),
    # What a policy is made with.
    "aloha-probability": flight("aloha", how={"probability": 0.5}),
    "csma-probability": flight("csma", how={"probability": 0.2}),
    "gnn-deterministic": flight("gnn", how={"is_deterministic": True}),
    # The authors' code.
    "reference-random-flooding-random-walk": flight("random-flooding", "random-walk", "reference"),
    "reference-random-flooding-flocking": flight("random-flooding", "flocking", "reference"),
    "reference-round-robin-stationary": flight("round-robin", "stationary", "reference"),
    "reference-mst-stationary": flight("mst", "stationary", "reference"),
    "reference-mst-random-walk": flight("mst", "random-walk", "reference"),
    "reference-mst-flocking": flight("mst", "flocking", "reference"),
    "reference-tdma-random-walk": flight("tdma", "random-walk", "reference"),
    "reference-gossip-flocking": flight("gossip", "flocking", "reference"),
    "reference-planner-flocking": flight("planner", "flocking", "reference"),
    "reference-greedy-oracle-stationary": flight("greedy-oracle", "stationary", "reference"),
    "reference-gnn-flocking": flight("gnn", "flocking", "reference"),
    "reference-bit-rate": flight("gossip", "random-walk", "reference", bit_rate=9e3),
    # The worlds.
    "indoor-planner": flight("planner", "random-walk", "indoor"),
    "indoor-gossip": flight("gossip", "random-walk", "indoor"),
    "indoor-gnn": flight("gnn", "random-walk", "indoor"),
    "indoor-spatial-tdma-stationary": flight("spatial-tdma", "stationary", "indoor"),
    "urban-planner": flight("planner", "random-walk", "urban"),
    "urban-planner-stationary": flight("planner", "stationary", "urban"),
    "urban-greedy-oracle": flight("greedy-oracle", "random-walk", "urban"),
    "urban-csma-flocking": flight("csma", "flocking", "urban"),
    "urban-sotdma": flight("sotdma", "random-walk", "urban"),
    "urban-40-robots": flight("tdma", "random-walk", "urban", num_robots=40),
    "open-field-planner": flight("planner", "random-walk", "open-field"),
    "open-field-age-gain-csma": flight("age-gain-csma", "flocking", "open-field"),
    "open-field-mst": flight("mst", "stationary", "open-field"),
    # The channel.
    "log-distance": flight("tdma", path_loss="log-distance", loss_exponent=2.5),
    "log-distance-aloha": flight("aloha", path_loss="log-distance", reference_m=50.0),
    "two-ray": flight("tdma", path_loss="two-ray"),
    "two-ray-csma": flight("csma", path_loss="two-ray", antenna_height_m=2.0),
    "shadowing": flight("gossip", shadowing_db=6.0),
    "shadowing-short": flight("tdma", shadowing_db=4.0, shadowing_distance_m=5.0),
    "shadowing-planner": flight("planner", "stationary", shadowing_db=6.0, num_windows=90),
    "rayleigh": flight("gossip", "flocking", fading="rayleigh"),
    "rayleigh-round-robin": flight("round-robin", "stationary", fading="rayleigh"),
    "rician": flight("tdma", fading="rician"),
    "rician-planner": flight("planner", fading="rician", rician_k=8.0),
    "erasure": flight("tdma", erasure=0.3),
    "erasure-greedy-oracle": flight("greedy-oracle", "stationary", erasure=0.2),
    "bursts": flight("gossip", burst_begin=0.1),
    "bursts-long": flight("tdma", burst_begin=0.05, burst_end=0.02),
    "high-power": flight("random-flooding", high_power_fraction=0.3),
    "high-power-sotdma": flight("sotdma", high_power_fraction=0.5, high_power_db=10.0),
    "clock-offset": flight("tdma", "stationary", clock_offset_s=0.03),
    "clock-offset-csma": flight("csma", clock_offset_s=0.06),
    "clock-offset-index-csma": flight("index-csma", clock_offset_s=0.06),
    "clock-drift": flight("gossip", clock_drift_ppm=5000.0),
    "clock-offset-drift-mst": flight("mst", "flocking", clock_offset_s=0.02, clock_drift_ppm=900.0),
    "clock-offset-rayleigh": flight("aloha", clock_offset_s=0.04, fading="rayleigh"),
    "sinr-threshold": flight("random-flooding", sinr_threshold_db=10.0),
    "noise-csma": flight("csma", noise_dbm=-94.0),
    "sensing-csma": flight("csma", sensing_dbm=-45.0),
    "sensing-age-gain-csma": flight("age-gain-csma", sensing_dbm=-52.0),
    "sensing-index-csma": flight("index-csma", sensing_dbm=-52.0),
    "frequency": flight("gossip", frequency_hz=9e8),
    "harsh-tdma": flight("tdma", **HARSH),
    "harsh-planner-stationary": flight("planner", "stationary", num_windows=70, **HARSH),
    "harsh-greedy-oracle": flight("greedy-oracle", **HARSH),
    "harsh-lookahead-oracle": flight("lookahead-oracle", **HARSH),
    "harsh-gnn": flight("gnn", **HARSH),
    # What robots know beforehand.
    "prior-map": flight("spatial-tdma", "random-walk", "urban", prior_knowledge="map"),
    "prior-map-offset": flight(
        "planner", "random-walk", "urban", prior_knowledge="map", map_offset_m=30.0
    ),
    "prior-statistics": flight("planner", prior_knowledge="statistics", **HARSH),
    "prior-statistics-sotdma": flight("sotdma", prior_knowledge="statistics", **HARSH),
    "prior-start": flight("planner", "flocking", prior_knowledge="start"),
    "prior-start-gossip": flight("gossip", prior_knowledge="start", position_noise_m=5.0),
    "prior-all": flight("planner", "stationary", "urban", prior_knowledge="map,statistics,start"),
    # Positions that err, robots that fail.
    "position-noise": flight("spatial-tdma", position_noise_m=20.0),
    "position-noise-planner": flight("planner", "stationary", position_noise_m=10.0),
    "position-noise-planner-none": flight(NONE, "stationary", position_noise_m=10.0),
    "position-noise-white": flight("planner", position_noise_m=5.0, position_noise_s=0.0),
    "failures-tdma": flight("tdma", failure_fraction=0.3),
    "failures-planner": flight("planner", "stationary", failure_fraction=0.25, num_windows=120),
    "failures-flocking": flight("gossip", "flocking", failure_fraction=0.5),
    "failures-all-but-two": flight("csma", failure_fraction=0.9),
    # Packets without room for all entries.
    "bit-rate-tdma": flight("tdma", bit_rate=8e3),
    "bit-rate-gossip": flight("gossip", "flocking", bit_rate=4e3),
    "bit-rate-index-csma": flight("index-csma", "stationary", bit_rate=9e3),
    "bit-rate-mst": flight("mst", "stationary", bit_rate=12e3),
    "bit-rate-greedy-oracle": flight("greedy-oracle", "stationary", bit_rate=9e3),
    "bit-rate-planner": flight("planner", "stationary", bit_rate=30e3),
    "bit-rate-planner-moving": flight("planner", bit_rate=250e3),
    "bit-rate-clock-offset": flight("random-flooding", bit_rate=6e3, clock_offset_s=0.03),
    # Arenas and physics.
    "arena-blocks": flight("tdma", arena="blocks", num_robots=20),
    "arena-forest": flight("gossip", "flocking", arena="forest"),
    "arena-rooms": flight("aloha", "stationary", arena="rooms"),
    "arena-file": flight("tdma", arena=ARENA_FILE),
    "contact": flight("tdma", **CONTACT),
    "contact-flocking": flight("random-flooding", "flocking", physics="contact"),
    "contact-collide": flight("tdma", collide=True, density_per_km2=9e3, range_ratio=0.05),
    "boundary-none": flight("tdma", boundary="none", velocity_ratio=1.0),
    "boundary-reflect-flocking": flight("tdma", "flocking", boundary="reflect", velocity_ratio=2.0),
    "wall-hit-clip": flight("tdma", wall_hit="clip", velocity_ratio=2.0),
    "eavesdroppers": flight("mst", half_duplex="eavesdroppers"),
    "flocking-set-moving": flight("tdma", "flocking", flocking_set="moving"),
    "window-of-50-ms": flight("tdma", "flocking", window_s=0.05, max_acceleration_mps2=5.0),
    # Teams: tiny, large, dense, sparse.
    "two-robots-tdma": flight("tdma", num_robots=2),
    "two-robots-planner": flight("planner", "stationary", num_robots=2),
    "two-robots-gnn": flight("gnn", "flocking", num_robots=2),
    "three-robots-planner": flight("planner", "flocking", num_robots=3, num_windows=60),
    "three-robots-sotdma": flight("sotdma", num_robots=3),
    "three-robots-mst": flight("mst", num_robots=3),
    "52-robots-planner": flight("planner", num_robots=52, num_windows=80),
    "ten-robots-planner-search": flight(
        "planner", num_robots=10, range_ratio=0.15, velocity_ratio=3.0, num_windows=200
    ),
    "six-robots-planner-long": flight("planner", num_robots=6, num_windows=200),
    "40-robots-planner-none": flight(NONE, "stationary", num_robots=40, num_windows=30),
    "40-robots-greedy-oracle": flight("greedy-oracle", num_robots=40, num_windows=20),
    "80-robots-tdma": flight("tdma", "flocking", num_robots=80),
    "80-robots-spatial-tdma": flight("spatial-tdma", num_robots=80, range_ratio=0.2),
    "80-robots-sotdma": flight("sotdma", num_robots=80, range_ratio=0.2, num_windows=150),
    "80-robots-gnn": flight("gnn", num_robots=80, num_windows=10),
    "range-of-1-km": flight("random-flooding", range_ratio=1.0),
    # Missions side by side.
    "batch-tdma": flight("tdma", seeds=(1, 2, 3)),
    "batch-planner": flight("planner", "flocking", seeds=(4, 5, 6), num_robots=8),
    "batch-planner-stationary": flight("planner", "stationary", seeds=(4, 5), num_robots=8),
    "batch-gnn": flight("gnn", seeds=(7, 8, 9)),
    "batch-greedy-oracle": flight("greedy-oracle", "stationary", seeds=(1, 2)),
    "batch-lookahead-oracle": flight("lookahead-oracle", seeds=(1, 2)),
    "batch-urban": flight("gossip", "random-walk", "urban", seeds=(1, 2), num_threads=2),
    "batch-harsh-failures": flight("csma", seeds=(3, 4), failure_fraction=0.3, **HARSH),
    "batch-clocks-bit-rate": flight("aloha", seeds=(3, 4), clock_offset_s=0.03, bit_rate=6e3),
    "restart-planner": flight("planner", seeds=(2, 3), restarts=True, shadowing_db=3.0),
    "restart-urban-sotdma": flight("sotdma", "random-walk", "urban", restarts=True),
    # Parts of a user's own.
    "own-policy": flight(AskTheStalest),
    "own-policy-broadcasts": flight(Chatter, "flocking", seeds=(1, 2)),
    "own-policy-centralised": flight(Westernmost),
    "own-channel": flight("tdma", channel=Nearest, seeds=(1, 2)),
    "own-channel-planner": flight("planner", "stationary", channel=Nearest),
    "own-channel-varies": flight("gossip", channel=EverySecondSlot),
    "own-channel-table": flight("tdma", channel=f"table:{GAINS_FILE}"),
    "own-controller": flight("tdma", controller=Gather, velocity_ratio=0.6),
    "own-controller-planner": flight("planner", "stationary", controller=Gather),
    "own-controller-brakes": flight("planner", num_robots=6, controller=Brake, num_windows=150),
    "own-controller-draws": flight("gossip", controller=Shake, seeds=(1, 2)),
    "own-scene": flight("tdma", scene="same_flights:two_walls", **CONTACT),
    "own-everything": flight(
        Chatter, channel=Nearest, controller="same_flights:Gather", scene="same_flights:two_walls"
    ),
}


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Policies on the same missions, as `swarm_mj.evaluate` takes them."""

    policies: tuple[str, ...]
    task: str | None = None
    fields: Mapping[str, Any]


RESULTS: tuple[Comparison, ...] = (
    Comparison(policies=("planner", "mst", "gossip"), task="flocking", fields={}),
    Comparison(policies=(NONE, "greedy-oracle"), task="stationary", fields={"erasure": 0.1}),
    Comparison(policies=("tdma", "gnn"), fields={"preset": "urban", "failure_fraction": 0.3}),
    Comparison(policies=("csma",), task="random-walk", fields={"bit_rate": 9e3}),
    Comparison(
        policies=("round-robin",), task="random-walk", fields={"controller": "same_flights:Gather"}
    ),
)

# Options of `swarm-mj train`. With these, the policy that is kept is one that has learned, and not
# the one that the training began with.
SHORT = "--windows 20 --missions 4 --held-out 2 --device cpu --threads 1"
TRAININGS: dict[str, str] = {
    "training-robot-extended": (
        f"{SHORT} --task flocking --robots 6 --latent 8 --silence-logit 1"
        " --budget 512 --evaluate-every 128"
    ),
    "training-robot-turns": (
        f"{SHORT} --task stationary --robots 5 7 --features turns --latent 8 --silence-logit 1"
        " --discount 0.5 --budget 512 --evaluate-every 128"
    ),
    "training-robot-local": (
        f"{SHORT} --task random-walk --robots 6 --features local --edges paper --latent 8"
        " --silence-logit 1 --preset urban --budget 512 --evaluate-every 128"
    ),
    "training-index": (
        "--policy index-csma --windows 20 --missions 2 --held-out 2 --task stationary --robots 5"
        " --budget 1440 --evaluate-every 960"
    ),
    "training-team-paper": (
        f"{SHORT} --credit team --task random-walk --robots 6 --latent 8"
        " --seed 1 --learning-rate 0.003 --budget 64 --evaluate-every 16"
    ),
    "training-team-reference": (
        f"{SHORT} --credit team --preset reference --task flocking --robots 6"
        " --reward velocity-variance --latent 6 --depth 2 --receptive-field 2 --linear --seed 1"
        " --learning-rate 0.003 --budget 64 --evaluate-every 16"
    ),
}
