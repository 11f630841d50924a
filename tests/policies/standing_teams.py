"""Teams that stand still, what they know, and what a window of Alg. 1 would make of it."""

import math
from dataclasses import dataclass

import numpy as np
from turns import settled

from swarm_mj.mission import Mission
from swarm_mj.mission.placement import connected_positions
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import team_views
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import LocalViews, broadcast, window
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import radio_of


def view_of(timestamp, position_m=0.0, velocity_mps=0.0, *, now=0.0, heard=None):
    """The view of robots that know this; they decoded nobody unless said otherwise."""
    buffers = empty_buffers(1, len(timestamp))
    buffers.timestamp[0], buffers.position_m[0] = timestamp, position_m
    buffers.velocity_mps[0] = velocity_mps
    views = LocalViews(buffers=buffers, now=np.array([now]), phases=())
    (view,) = team_views(views)
    return view if heard is None else view._replace(heard=heard)


@dataclass(frozen=True, kw_only=True)
class Team:
    """A connected team after some windows of random flooding."""

    radio: FreeSpaceRadio
    position_m: np.ndarray  # [robot, axis]
    timestamp: np.ndarray  # T, [robot, subject], in windows
    now: float  # t [windows]

    @property
    def num_robots(self):
        return len(self.position_m)


def received(links, speakers, j):
    """Whom j hears of these, and how probably: Eqs. 3-4, and the law of doubt."""
    if j in speakers or not speakers:
        return None, 0.0
    power_mw = {i: float(links.received_mw[i, j]) for i in speakers}
    sender = max(power_mw, key=power_mw.__getitem__)
    others_mw = sum(power for i, power in power_mw.items() if i != sender)
    ratio = power_mw[sender] / (links.noise_mw + others_mw) / links.threshold
    distance_over_std = float(links.distance_over_std[sender, j])
    if power_mw[sender] == 0.0 or math.isinf(distance_over_std):
        return sender, float(power_mw[sender] > 0.0 and ratio >= 1.0)
    deviations = (math.sqrt(ratio) - 1.0) * distance_over_std
    if abs(deviations) > 2.5:
        return sender, float(deviations > 0.0)
    return sender, 1.0 / (1.0 + math.exp(-1.702 * deviations))


def flooded_team(mission: Mission, seed: int) -> Team:
    """A team of the mission; 0 to 9 windows have passed, in which a fifth of all spoke."""
    rng = np.random.default_rng(seed)
    robots, radio = np.arange(mission.num_robots), radio_of(mission)
    position_m = connected_positions(len(robots), mission.half_side_m, mission.range_m, rng)
    states = RobotStates(position_m=position_m[None], velocity_mps=np.zeros((1, len(robots), 2)))
    buffers, now = empty_buffers(1, len(robots)), np.zeros(1)
    for _ in range(2 * rng.integers(0, 10)):
        speaks = rng.random(len(robots)) < 0.2
        anyone = rng.integers(0, len(robots), len(robots))
        broadcast(buffers, states, np.where(speaks, anyone, robots)[None], radio, now)
        now = now + SLOT_WINDOWS
    return Team(
        radio=radio, position_m=position_m, timestamp=buffers.timestamp[0], now=float(now[0])
    )


def knowledge_after(team: Team, choices: np.ndarray) -> np.ndarray:
    """The sum of all T after one window, for each choice of recipients, side by side [windows]."""
    shape = (len(choices), team.num_robots)
    buffers = empty_buffers(*shape)
    buffers.timestamp[:] = team.timestamp
    states = RobotStates(
        position_m=np.broadcast_to(team.position_m, (*shape, 2)).copy(),
        velocity_mps=np.zeros((*shape, 2)),
    )
    window(buffers, *settled(states, choices), team.radio, np.full(len(choices), team.now))
    return np.sum(buffers.timestamp, axis=(1, 2))


def single_pairs(num_robots: int) -> np.ndarray:
    """For every i and r, the recipients by which i alone speaks, to r [i and r, robot]."""
    choices = np.tile(np.arange(num_robots), (num_robots**2, 1))
    for pair in range(num_robots**2):
        i, r = divmod(pair, num_robots)
        choices[pair, i] = r
    return choices
