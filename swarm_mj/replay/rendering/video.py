"""Videos as bytes: MP4 that browsers play, and GIF."""

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction

import av
import numpy as np
from jaxtyping import UInt8
from PIL import Image

from swarm_mj.replay.footage import Footage
from swarm_mj.replay.rendering.movie import Movie
from swarm_mj.replay.rendering.style import DEFAULTS, GIF, VideoStyle, fitted

Picture = UInt8[np.ndarray, "H W 3"]

QUALITY = "20"  # x264's constant rate factor: no loss is seen
SAMPLES = 8  # pictures that a GIF's colours are taken from
NUM_COLOURS = 255  # of a GIF; the last one is for what does not change


def make_video(
    footages: Sequence[Footage],
    suffix: str = ".mp4",
    style: VideoStyle | None = None,
    on_picture: Callable[[], object] = lambda: None,
) -> bytes:
    """Return the file of a video of one mission, or of two side by side.

    Args:
        footages: From `footage_of` or `read_footage`.
        suffix: `.mp4` or `.gif`.
        style: Size and length; a GIF's is `fitted`.
        on_picture: Called after each picture.

    Raises:
        ValueError: There are not one or two missions, the suffix is another, or a GIF cannot show
            so many pictures per second.
        OSError: No OpenGL works here; it says what to install.
    """
    if suffix not in DEFAULTS:
        raise ValueError(f"a video is {' or '.join(DEFAULTS)}, not {suffix}")
    style = fitted(style or VideoStyle(), suffix)
    with Movie(footages, style) as movie:

        def pictures() -> Iterator[Picture]:
            for picture in movie:
                yield picture
                on_picture()

        if suffix != GIF:
            return encode_mp4(pictures(), style)
        shares = np.linspace(0.0, 1.0, SAMPLES)
        rows = ([round(share * (len(each.window) - 1)) for each in footages] for share in shares)
        return encode_gif(pictures(), style, [movie.picture(each) for each in rows])


def encode_mp4(pictures: Iterable[Picture], style: VideoStyle) -> bytes:
    """Return an H.264 video in the pixel format that every browser plays."""
    content = io.BytesIO()
    with av.open(content, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(style.fps).limit_denominator())
        stream.width, stream.height = style.width, style.height
        stream.pix_fmt = "yuv420p"  # the only one that all browsers play
        stream.options = {"crf": QUALITY, "preset": "fast"}
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return content.getvalue()


def encode_gif(pictures: Iterable[Picture], style: VideoStyle, samples: Sequence[Picture]) -> bytes:
    """Return a GIF that starts over and over; its colours are those of the samples."""
    colours = _colours(samples)
    images = (
        Image.fromarray(picture).quantize(palette=colours, dither=Image.Dither.NONE)
        for picture in pictures
    )
    content = io.BytesIO()
    first, lasts_ms = next(images), round(1000.0 / style.fps)
    first.save(content, "gif", save_all=True, append_images=images, duration=lasts_ms, loop=0)
    return content.getvalue()


def _colours(samples: Sequence[Picture]) -> Image.Image:
    """Return the palette; what fills little of a picture, such as lost packets, is in it, too."""
    pixels = np.concatenate([sample.reshape(-1, 3) for sample in samples]).astype(np.int32)
    packed, counts = np.unique(pixels @ (1 << 16, 1 << 8, 1), return_counts=True)
    # By the roots of their numbers, so that the dark ground does not take all of them.
    repeated = np.repeat(packed, np.ceil(np.sqrt(counts)).astype(int))
    rgb = np.stack([repeated >> shift & 255 for shift in (16, 8, 0)], axis=-1)
    montage = Image.fromarray(rgb[None].astype(np.uint8))
    return montage.quantize(NUM_COLOURS, method=Image.Quantize.MEDIANCUT)
