"""Videos: what is where in their pictures; size, length and colours, decoded again."""

import io
import itertools
from dataclasses import fields, replace

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from swarm_mj.replay import palette
from swarm_mj.replay.links import NO_MISMATCH
from swarm_mj.replay.rendering import drawing
from swarm_mj.replay.rendering.video import Movie, encode_gif, encode_mp4, make_video
from swarm_mj.replay.view import VideoStyle

with_opengl = pytest.mark.usefixtures("opengl")
MEAN_AGE = np.array(palette.FILM_CURVES[0], dtype=int)
STYLE = VideoStyle(width=480, height=320, seconds=1.0, fps=6)


@pytest.fixture(scope="module")
def team(two_way):
    """30 windows of 12 robots."""
    return two_way.log


@with_opengl
def test_there_are_as_many_pictures_as_asked_for_from_the_first_window_to_the_last(team):
    with Movie([team], STYLE) as movie:
        pictures = list(movie)
        np.testing.assert_array_equal(pictures[0], movie.picture([0]))
        np.testing.assert_array_equal(pictures[-1], movie.picture([29]))
    assert len(pictures) == 6
    assert all(picture.shape == (320, 480, 3) for picture in pictures)
    for one, next_one in itertools.pairwise(pictures):
        assert np.any(one[:250] != next_one[:250])  # the scene
        is_bright = [
            np.abs(each[250:, 160:] - MEAN_AGE).max(axis=2) < 30 for each in (one, next_one)
        ]
        assert np.sum(is_bright[0]) < np.sum(is_bright[1])  # the curve so far


@with_opengl
def test_two_missions_stand_side_by_side_and_the_shorter_one_stops(team):
    """Six pictures of 30 windows: the other mission's 18th is its last from the fourth on."""
    kept = {}
    for field in fields(team):
        value = getattr(team, field.name)
        if isinstance(value, np.ndarray):
            kept[field.name] = value[:18]
    shorter = replace(team, **kept)
    with Movie([team, shorter], STYLE) as movie:
        pictures = list(movie)
    halves = [picture[:240, 250:] for picture in pictures]  # of the second mission, without text
    assert np.any(halves[0] != halves[1])
    np.testing.assert_array_equal(halves[3], halves[5])
    assert np.any(pictures[3][:240, :230] != pictures[5][:240, :230])


@with_opengl
def test_a_light_video_is_light_and_titles_of_two_stand_above_the_ground(team):
    with Movie([team, team], replace(STYLE, theme="light")) as movie:
        picture = movie.picture([29, 29]).astype(int)
    assert np.median(picture) > 220
    is_coloured = np.ptp(picture, axis=2) > 40
    top = drawing.title_height(team, 10)
    assert not np.any(is_coloured[:top, 250:370])
    assert np.any(is_coloured[top:230])


@with_opengl
@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_mission_s_video_has_all_pictures(team, suffix):
    seen = []
    content = make_video([team], suffix, STYLE, lambda: seen.append(1))
    with av.open(io.BytesIO(content)) as container:
        shapes = [(frame.height, frame.width) for frame in container.decode(video=0)]
    assert shapes == [(320, 480)] * 6
    assert len(seen) == 6


@with_opengl
def test_links_that_surprise_and_their_shortfalls_are_seen(blocked):
    city = blocked.log
    row = max(range(30), key=lambda row: len(city.shortfalls(row)[1]))
    is_cut_off = np.zeros_like(city.is_cut_off)
    without = replace(city, mismatch=NO_MISMATCH, is_cut_off=is_cut_off)
    num_red = []
    for footage in (city, without):
        with Movie([footage], STYLE) as movie:
            picture = movie.picture([row])[:250].astype(int)
        num_red.append(np.sum(picture[..., 0] - picture[..., 1:].max(axis=2) > 60))
    seen, unseen = num_red
    assert seen > 100
    assert unseen == 0


@with_opengl
def test_the_numbers_of_bodies_stand_as_high_as_they_are(monkeypatch, high):
    """A robot in the air is seen farther up than one below it on the floor."""
    seen = []
    monkeypatch.setattr(drawing, "draw_shortfalls", lambda _draw, robots, *_: seen.append(robots))
    on_floor = replace(high.log, height_m=np.zeros_like(high.log.height_m))
    for footage in (high.log, on_floor):
        with Movie([footage], STYLE) as movie:
            movie.picture([5])
    in_air, below = seen
    is_high = high.log.height_m[5] > 5.0
    assert np.any(is_high)
    assert np.all(in_air[is_high, 1] < below[is_high, 1] - 1.0)


@with_opengl
def test_from_nearby_robots_move_between_windows_too(high):
    with Movie([high.log], replace(STYLE, camera="chase")) as movie:
        pictures = [movie.picture([5.0 + k / 3.0]) for k in range(4)]
    for one, next_one in itertools.pairwise(pictures):
        assert np.any(one[70:250] != next_one[70:250])


PLAIN = VideoStyle(width=320, height=240, seconds=1.0, fps=10)
COLOURS = [palette.LOST, palette.DELIVERED, palette.BROADCAST, palette.EGO]


def moving():
    """A square of each colour on the dark ground, which moves to the right."""
    for k in range(PLAIN.num_frames):
        picture = np.full((PLAIN.height, PLAIN.width, 3), palette.BACKGROUND, dtype=np.uint8)
        for row, colour in enumerate(COLOURS):
            picture[20 + 50 * row : 40 + 50 * row, 10 + 8 * k : 30 + 8 * k] = colour
        yield picture


def test_an_mp4_gives_back_its_pictures_and_browsers_can_play_it():
    with av.open(io.BytesIO(encode_mp4(moving(), PLAIN))) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert float(stream.duration * stream.time_base) == pytest.approx(1.0)
        back = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    for picture, original in zip(back, moving(), strict=True):
        assert np.abs(picture.astype(int) - original).mean() < 4.0


def test_a_gif_keeps_colours_that_fill_little_of_it():
    content = encode_gif(moving(), PLAIN, list(moving()))
    with Image.open(io.BytesIO(content)) as image:
        pictures = [np.asarray(each.convert("RGB")) for each in ImageSequence.Iterator(image)]
    assert len(pictures) == 10
    for k, picture in enumerate(pictures):
        for row, colour in enumerate(COLOURS):
            np.testing.assert_allclose(picture[30 + 50 * row, 20 + 8 * k], colour, atol=8)


def test_a_gif_lasts_as_long_as_it_should_even_if_pictures_repeat():
    """Equal pictures that follow each other are kept as one that lasts longer."""
    still = [next(moving())] * 4 + list(moving())[4:]
    with Image.open(io.BytesIO(encode_gif(still, PLAIN, still))) as image:
        lasts_ms = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert sum(lasts_ms) == 1000


def test_other_files_and_more_missions_are_refused(team):
    with pytest.raises(ValueError, match=r"a video is \.mp4 or \.gif, not \.avi"):
        make_video([], ".avi")
    with pytest.raises(ValueError, match="a video shows 1 or 2 missions, not 3"):
        make_video([team] * 3)
