"""Replays as exports read them, and what there was to be counted."""

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


@pytest.fixture
def nothing():
    """Counts no windows."""
    return lambda: None
