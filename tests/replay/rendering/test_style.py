"""A video lasts as long as it is meant to, whatever its kind of file can count."""

from types import SimpleNamespace

import pytest

from swarm_mj.replay.rendering.style import VideoStyle, default_seconds, fitted, video_needs


@pytest.mark.parametrize(
    ("fps", "lasts_ms", "num_frames"),
    [(15, 70, 143), (25, 40, 250), (50, 20, 500), (1, 1000, 10), (40, 20, 500), (30, 30, 333)],
)
def test_a_gif_counts_in_hundredths_of_a_second(fps, lasts_ms, num_frames):
    """Ten seconds of pictures that last so long each."""
    style = fitted(VideoStyle(seconds=10.0, fps=fps), ".gif")
    assert 1000 / style.fps == pytest.approx(lasts_ms)
    assert style.num_frames == num_frames
    assert fitted(style, ".gif") == style
    assert abs(num_frames * lasts_ms - 10_000) <= lasts_ms / 2


def test_an_mp4_has_what_is_asked_for():
    assert fitted(VideoStyle(seconds=10.0, fps=15), ".mp4").num_frames == 150


def test_a_gif_cannot_be_as_fast_as_an_mp4():
    with pytest.raises(ValueError, match="at most 50, not 60; or make an MP4"):
        fitted(VideoStyle(fps=60), ".gif")
    assert fitted(VideoStyle(fps=60), ".mp4").fps == 60


@pytest.mark.parametrize(("num_windows", "seconds"), [([3], 1.0), ([40, 25], 4.0), ([500], 10.0)])
def test_missions_are_shown_in_their_own_time_within_reason(num_windows, seconds):
    facts = SimpleNamespace(mission=SimpleNamespace(window_s=0.1))
    footages = [SimpleNamespace(window=range(number), facts=facts) for number in num_windows]
    assert default_seconds(footages) == pytest.approx(seconds)


def test_a_gif_s_pictures_are_kept_and_an_mp4_s_are_not():
    """500 pictures of 1000 by 1000."""
    gif, mp4 = (video_needs(1000, 1000, 500.0, suffix) for suffix in (".gif", ".mp4"))
    assert gif.memory - mp4.memory == pytest.approx(750e6)
    assert video_needs(1000, 1000, 5000.0, ".mp4").memory == mp4.memory
