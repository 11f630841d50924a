"""Replays as exports read them, and what there was to be counted."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.replay.read import read_flown


@pytest.fixture(scope="session")
def requests(replay):
    """A flight of addressed packets, read back."""
    return read_flown(replay)


@pytest.fixture(scope="session")
def broadcasts(flood_replay):
    """A flight of broadcasts, read back."""
    return read_flown(flood_replay)


@pytest.fixture(scope="session")
def bodies(high_replay):
    """A flight of quadrotors at several heights, and rovers, read back."""
    return read_flown(high_replay)


@pytest.fixture(scope="session")
def climbing(bodies):
    """The same, but that all robots climb by 0.2 m in each window of 0.1 s."""
    climbed_m = 0.2 * np.arange(len(bodies.footage.window))
    height_m = bodies.footage.height_m[:1] + climbed_m[:, None]
    return replace(bodies, footage=replace(bodies.footage, height_m=height_m))


@pytest.fixture
def nothing():
    """Counts no windows."""
    return lambda: None
