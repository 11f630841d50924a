"""Estimates of videos, by hand; those of replays are tested with flights."""

import pytest

from swarm_mj.replay.estimates import video_needs


def test_a_gif_s_pictures_are_kept_and_an_mp4_s_are_not():
    """500 pictures of 1000 by 1000."""
    gif, mp4 = (video_needs(1000, 1000, 500.0, suffix) for suffix in (".gif", ".mp4"))
    assert gif.memory - mp4.memory == pytest.approx(750e6)
    assert video_needs(1000, 1000, 5000.0, ".mp4").memory == mp4.memory
