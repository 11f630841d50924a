"""The programs whose speed `peers.py` compares, each as a step of its missions.

VMAS (GPL-3.0) is in no environment of the package: `make bench-peers` gives it one of its own. The
authors' code is of older libraries; `stand_ins` says what it is given in their place.
"""

import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module, metadata
from itertools import cycle
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Protocol

import gymnasium
import numpy as np

import swarm_mj  # noqa: F401  (registers its environments)
from swarm_mj.cli.bench_simulation import MISSION, plain_step
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.packages import version

NUM_AGENTS = MISSION.num_robots
SIDE_BY_SIDE = (1, 32, 1024)  # missions, of programs that take several
SEED = 1
NUM_ACTIONS = 16  # drawn ahead for VMAS, and repeated: drawing is no part of a step
NUM_FOOD = 4  # of VMAS's dispersion: its own default, which with 40 agents would be 40

AUTHORS = "https://github.com/landonbutler/Learning-Connectivity"
AUTHORS_COMMIT = "a423d8d"
GET_AUTHORS = (
    f"git clone {AUTHORS} DIR && git -C DIR checkout {AUTHORS_COMMIT}, "
    'then make bench-peers ARGS="--authors DIR"'
)
GET_VMAS = "make bench-peers installs it in .venv/peers"
# What NumPy 2 no longer has, and the authors' code uses.
OLD_NUMPY = {"Inf": np.inf, "PINF": np.inf, "NINF": -np.inf, "int": int, "float": float}
COPIED = "a copy of unknown commit"


@dataclass(frozen=True, kw_only=True)
class Arm:
    """A program to measure: `step` takes all of its missions one step further."""

    arm: str  # its key in the file
    name: str
    missions: int  # side by side
    has: str  # what a step does
    version: str
    step: Callable[[], object]


class VmasEnvironment(Protocol):
    """What is used of an environment of VMAS."""

    num_envs: int
    agents: Sequence[object]

    def step(self, actions: Sequence[object], /) -> object:
        """Take all of its missions one step further."""
        ...


class AuthorsEnvironment(Protocol):
    """What is used of the authors' environment."""

    get_relative_network_buffer_as_dict: Callable[[], object]  # the features of their network

    def roundrobin_controller(self) -> object:
        """Return who addresses whom, as their policy decides."""
        ...

    def step(self, attempted_transmissions: object, /) -> object:
        """Take the mission one window further."""
        ...


def own_arms() -> Iterator[Arm]:
    """Yield the random walks of this package, in which robots talk in turn."""
    common = "MuJoCo, two radio slots, buffers, ages and costs"
    for num_missions in SIDE_BY_SIDE:
        yield Arm(
            arm=f"swarm_mj_{num_missions}",
            name="swarm_mj, Swarm.step",
            missions=num_missions,
            has=f"{common}, a policy; no observations",
            version=version(),
            step=own_step(num_missions),
        )
    for num_missions in SIDE_BY_SIDE:
        yield Arm(
            arm=f"swarm_mj_env_{num_missions}",
            name="swarm_mj, gymnasium.make_vec",
            missions=num_missions,
            has=f"{common}; observations of all pairs of agents, masks, rewards",
            version=version(),
            step=own_environment_step(num_missions),
        )


def own_step(num_missions: int) -> Callable[[], object]:
    """Return a window of missions side by side, as `swarm-mj bench` measures it."""
    swarm = Swarm(MISSION, range(num_missions))
    policy = RoundRobin()
    swarm.start(policy)
    return lambda: swarm.step(policy)


def own_environment_step(num_missions: int) -> Callable[[], object]:
    """Return a step of the environments of missions side by side."""
    envs: Any = gymnasium.make_vec(
        "swarm_mj/RandomWalk-v0",
        num_envs=num_missions,
        vectorization_mode="vector_entry_point",
        num_robots=NUM_AGENTS,
    )
    envs.reset(seed=SEED)
    actions = []
    for robot in range(NUM_AGENTS):
        action = np.tile(np.arange(NUM_AGENTS), (num_missions, 1))  # itself: it is silent
        action[:, robot] = (robot + 1) % NUM_AGENTS
        actions.append(action)
    turns = cycle(actions)
    return lambda: envs.step(next(turns))


def mujoco_arms() -> Iterator[Arm]:
    """Yield MuJoCo without anything of ours but the scene."""
    yield Arm(
        arm="mujoco_1",
        name="MuJoCo alone, mj_step of our scene",
        missions=1,
        has="its physics; no radio, no observations",
        version=metadata.version("mujoco"),
        step=plain_step(),
    )


def vmas_arms() -> Iterator[Arm]:
    """Yield VMAS's scenarios; raises ModuleNotFoundError without it."""
    torch = import_module("torch")
    vmas = import_module("vmas")
    torch.set_num_threads(1)  # the clock is that of one thread
    found = metadata.version("vmas")
    for num_missions in SIDE_BY_SIDE:
        yield Arm(
            arm=f"vmas_flocking_{num_missions}",
            name="VMAS, flocking",
            missions=num_missions,
            has="its physics with collisions, lidar, observations, rewards; no radio",
            version=found,
            step=vmas_step(vmas.make_env("flocking", **_of_vmas(num_missions)), torch),
        )
    for num_missions in SIDE_BY_SIDE:
        env = vmas.make_env("dispersion", n_food=NUM_FOOD, **_of_vmas(num_missions))
        yield Arm(
            arm=f"vmas_dispersion_{num_missions}",
            name="VMAS, dispersion",
            missions=num_missions,
            has="its physics without collisions, observations, rewards; no radio",
            version=found,
            step=vmas_step(env, torch),
        )
    for num_missions in SIDE_BY_SIDE:
        env = vmas.make_env("dispersion", n_food=NUM_FOOD, **_of_vmas(num_missions))
        vmas_step(env, torch)()  # gives agents the forces that the world goes on with
        yield Arm(
            arm=f"vmas_world_{num_missions}",
            name="VMAS alone, world.step of dispersion",
            missions=num_missions,
            has="its physics without collisions; no radio, no observations",
            version=found,
            step=env.world.step,
        )


def _of_vmas(num_missions: int) -> dict[str, Any]:
    return {"num_envs": num_missions, "device": "cpu", "seed": SEED, "n_agents": NUM_AGENTS}


def vmas_step(env: VmasEnvironment, torch: ModuleType) -> Callable[[], object]:
    """Return a step of a VMAS environment whose agents push in random directions.

    Half of the pushes are the opposite of the others, so that agents stay near each other.
    """
    rng = torch.Generator().manual_seed(SEED)
    actions = []
    for _ in range(NUM_ACTIONS // 2):
        push = [2.0 * torch.rand(env.num_envs, 2, generator=rng) - 1.0 for _ in env.agents]
        actions.append(push)
        actions.append([-each for each in push])
    turns = cycle(actions)
    return lambda: env.step(next(turns))


def authors_arms(folder: Path) -> Iterator[Arm]:
    """Yield the authors' random walks, with and without the features of their network.

    Raises ValueError if the folder has no such code, ModuleNotFoundError if gym is missing.
    """
    found = authors_version(folder)
    common = "their Eq. 15, two radio slots, buffers, ages, a policy"
    full = authors_environment(folder)
    yield Arm(
        arm="authors_1",
        name="the authors' environment",
        missions=1,
        has=f"{common}, their network's features",
        version=found,
        step=lambda: full.step(full.roundrobin_controller()),
    )
    bare = authors_environment(folder)
    bare.get_relative_network_buffer_as_dict = dict  # an empty one
    yield Arm(
        arm="authors_without_features_1",
        name="the authors' environment without features",
        missions=1,
        has=f"{common}; no observations",
        version=found,
        step=lambda: bare.step(bare.roundrobin_controller()),
    )


def authors_environment(folder: Path) -> AuthorsEnvironment:
    """Return the authors' random walk of 40 agents; errors as of `authors_arms`."""
    if not (folder / "aoi_envs" / "Mobile.py").exists():
        raise ValueError(f"--authors {folder}: no aoi_envs/Mobile.py in it; {GET_AUTHORS}")
    with stand_ins(folder):
        base = import_module("aoi_envs.MultiAgent")
        moving = import_module("aoi_envs.Mobile")
    for module in (base, moving):
        module.__dict__["np"] = SimpleNamespace(**vars(np) | OLD_NUMPY)
    np.random.seed(SEED)  # noqa: NPY002  (theirs draws from NumPy's global generator)
    env = moving.MobileEnv(num_agents=NUM_AGENTS)
    env.reset()
    return env


@contextmanager
def stand_ins(folder: Path) -> Iterator[None]:
    """Let the authors' modules be imported: from their folder, with a TensorFlow that is empty.

    Their environments import TensorFlow for their network only. gym is the 0.26.2 that comes with
    VMAS, rather than 0.11, and NumPy is ours with the names that it had before version 2.
    """
    sys.path.insert(0, str(folder))
    had = sys.modules.get("tensorflow")
    sys.modules["tensorflow"] = ModuleType("tensorflow")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # of its `is` between texts
            yield
    finally:
        sys.path.remove(str(folder))
        del sys.modules["tensorflow"]
        if had is not None:
            sys.modules["tensorflow"] = had


def authors_version(folder: Path) -> str:
    """Return the short commit of a clone; of files that git does not know, that they are a copy."""
    if not (folder / ".git").exists():  # a folder above may be a clone, but of something else
        return COPIED
    command = ["git", "-C", str(folder), "rev-parse", f"--short={len(AUTHORS_COMMIT)}", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, check=True, encoding="utf-8")
    except (OSError, subprocess.CalledProcessError):
        return COPIED
    return done.stdout.strip()
