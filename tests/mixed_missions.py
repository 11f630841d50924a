"""Missions that nothing tells apart but what one robot cannot know.

They are missions of random talk. A robot knows its own buffer, and what it sent and decoded; a
packet holds its sender's buffer and says whom it is for.
"""

import copy

import numpy as np

from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm

NUM_ROBOTS, NUM_WINDOWS, SEEDS = 7, 60, (3, 4)
MISSION = paper("random-walk", num_robots=NUM_ROBOTS)


def random_recipients(seed, share=0.3):
    """A share of all speaks, to anyone [window, mission, robot]."""
    rng = np.random.default_rng(seed)
    shape = (NUM_WINDOWS, len(SEEDS), NUM_ROBOTS)
    anyone = rng.integers(0, NUM_ROBOTS, shape)
    return np.where(rng.random(shape) < share, anyone, np.arange(NUM_ROBOTS))


def flown(seed):
    """What everyone knew before each window of random talk, and after the last."""
    swarm = Swarm(MISSION, SEEDS)
    views = [copy.deepcopy(swarm.views)]
    for recipient in random_recipients(seed):
        swarm.step_with_recipients(recipient)
        views.append(copy.deepcopy(swarm.views))
    return views


def causes(views, b, robot):
    """Whose packets a robot's memory of a window rests on: whom it decoded, and whom those did."""
    transmission, response = (phase.heard[b] for phase in views.phases)
    first, second = int(transmission[robot]), int(response[robot])
    return sorted({robot, first, second, int(transmission[second])})


def with_causes_of(robot, mine, theirs, after):
    """A copy of `theirs` that keeps of `mine` what a robot can know.

    These are its own rows, and those of the robots whose packets it decodes in the window `after`
    and has just decoded.
    """
    mixed = copy.deepcopy(theirs)
    for b in range(len(SEEDS)):
        kept = causes(after, b, robot) if after else [robot]
        for name, array in vars(mixed.buffers).items():
            if array.ndim > 1:  # by robots
                array[b, kept] = getattr(mine.buffers, name)[b, kept]
        for own, other in zip(mine.phases, mixed.phases, strict=True):
            for known, array in zip(own, other, strict=True):
                array[b, causes(mine, b, robot)] = known[b, causes(mine, b, robot)]
    return mixed


def mixed_views(robot):
    """A mission, and another that nothing tells from it but what this robot cannot know."""
    mine, theirs = flown(1), flown(2)
    afters = [*mine[1:], None]
    return mine, [with_causes_of(robot, *these) for these in zip(mine, theirs, afters, strict=True)]
