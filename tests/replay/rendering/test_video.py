"""Videos, decoded again: size, length, colours, and who is refused."""

import io

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from swarm_mj.replay import palette
from swarm_mj.replay.rendering.style import VideoStyle
from swarm_mj.replay.rendering.video import encode_gif, encode_mp4, make_video

STYLE = VideoStyle(width=320, height=240, seconds=1.0, fps=10)
COLOURS = [palette.LOST, palette.DELIVERED, palette.BROADCAST, palette.EGO]


def moving():
    """A square of each colour on the dark ground, which moves to the right."""
    for k in range(STYLE.num_frames):
        picture = np.full((STYLE.height, STYLE.width, 3), palette.BACKGROUND, dtype=np.uint8)
        for row, colour in enumerate(COLOURS):
            picture[20 + 50 * row : 40 + 50 * row, 10 + 8 * k : 30 + 8 * k] = colour
        yield picture


def decoded(content, suffix):
    if suffix == ".gif":
        with Image.open(io.BytesIO(content)) as image:
            for k in range(image.n_frames):
                image.seek(k)
                yield np.asarray(image.convert("RGB"))
        return
    with av.open(io.BytesIO(content)) as container:
        for frame in container.decode(video=0):
            yield frame.to_ndarray(format="rgb24")


def made(suffix):
    pictures = list(moving())
    return (
        encode_gif(pictures, STYLE, pictures) if suffix == ".gif" else encode_mp4(pictures, STYLE)
    )


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_video_gives_back_its_pictures(suffix):
    back = list(decoded(made(suffix), suffix))
    assert len(back) == STYLE.num_frames
    for picture, original in zip(back, moving(), strict=True):
        assert picture.shape == original.shape
        assert np.abs(picture.astype(int) - original).mean() < 4.0


def test_a_gif_keeps_colours_that_fill_little_of_it():
    for picture, k in zip(decoded(made(".gif"), ".gif"), range(10), strict=True):
        for row, colour in enumerate(COLOURS):
            np.testing.assert_allclose(picture[30 + 50 * row, 20 + 8 * k], colour, atol=8)


def test_a_gif_lasts_as_long_as_it_should_even_if_pictures_repeat():
    """Equal pictures that follow each other are kept as one that lasts longer."""
    still = [next(moving())] * 4 + list(moving())[4:]
    with Image.open(io.BytesIO(encode_gif(still, STYLE, still))) as image:
        lasts_ms = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert sum(lasts_ms) == 1000


def test_browsers_can_play_an_mp4():
    with av.open(io.BytesIO(made(".mp4"))) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert float(stream.duration * stream.time_base) == pytest.approx(1.0)


def test_other_kinds_of_files_are_refused():
    with pytest.raises(ValueError, match=r"a video is \.mp4 or \.gif, not \.avi"):
        make_video([], ".avi")
