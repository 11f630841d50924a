"""Videos as bytes: MP4 that browsers play, and GIF."""

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageSequence

from swarm_mj.replay.footage import Footage
from swarm_mj.replay.rendering.movie import Movie
from swarm_mj.replay.rendering.style import GIF, Style, fitted

Picture = UInt8[np.ndarray, "H W 3"]

QUALITY = "20"  # x264's constant rate factor: no loss is seen
SAMPLES = 8  # pictures that a GIF's colours are taken from
NUM_COLOURS = 255  # of a GIF; the last one is for what does not change


def make_video(
    footages: Sequence[Footage],
    suffix: str = ".mp4",
    style: Style | None = None,
    on_picture: Callable[[], object] = lambda: None,
) -> bytes:
    """Return a video of one mission, or of two side by side.

    Args:
        footages: What is shown, from `footage_of` or `read_footage`.
        suffix: `.mp4` or `.gif`.
        style: Size and length; a GIF's is `fitted`.
        on_picture: Called after each picture.

    Returns:
        The file's content.

    Raises:
        ValueError: There are not one or two missions, the suffix is another, or a GIF cannot show
            so many pictures per second.
        OSError: No OpenGL works here; it says what to install.
    """
    if suffix not in ENCODERS:
        raise ValueError(f"a video is {' or '.join(ENCODERS)}, not {suffix}")
    style = fitted(style or Style(), suffix)
    with Movie(footages, style) as movie:
        samples = [movie.picture(rows) for rows in _samples(footages)] if suffix == GIF else []

        def pictures() -> Iterator[Picture]:
            for picture in movie:
                yield picture
                on_picture()

        return ENCODERS[suffix](pictures(), style, samples)


def check_video(path: Path, suffix: str, style: Style) -> None:
    """Pass for a video that is whole.

    Raises:
        ValueError: It does not have the pictures that it should, not in this size, or does not
            last as long.
    """
    style = fitted(style, suffix)
    found, size, seconds = _look_at_gif(path, style) if suffix == GIF else _look_at_mp4(path)
    if found != style.num_frames or size != (style.width, style.height):
        raise ValueError(f"{found} pictures of {size} were found, not {style.num_frames}")
    if abs(seconds - style.seconds) > 1.0 / style.fps:
        raise ValueError(f"{seconds:g} s were found, not {style.seconds:g} s")


def _look_at_mp4(path: Path) -> tuple[int, tuple[int, int], float]:
    """How many pictures there are, their size, and how long they last [s]."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        size, rate = (stream.width, stream.height), float(stream.average_rate or 1)
        found = sum(1 for _ in container.decode(video=0))
        return found, size, found / rate


def _look_at_gif(path: Path, style: Style) -> tuple[int, tuple[int, int], float]:
    """As for an MP4; equal pictures that follow each other are kept as one that lasts longer."""
    with Image.open(path) as image:
        seconds = (
            sum(frame.info.get("duration", 0.0) for frame in ImageSequence.Iterator(image)) / 1000.0
        )
        return round(seconds * style.fps), image.size, seconds


def _samples(footages: Sequence[Footage]) -> Iterator[list[int]]:
    for share in np.linspace(0.0, 1.0, SAMPLES):
        yield [round(share * (len(each.window) - 1)) for each in footages]


def encode_mp4(pictures: Iterable[Picture], style: Style, _: Sequence[Picture] = ()) -> bytes:
    """Return an H.264 video in the pixel format that every browser plays."""
    content = io.BytesIO()
    with av.open(content, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(style.fps).limit_denominator())
        stream.width, stream.height = style.width, style.height
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": QUALITY, "preset": "fast"}
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return content.getvalue()


def encode_gif(pictures: Iterable[Picture], style: Style, samples: Sequence[Picture]) -> bytes:
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
    """The palette: what fills little of a picture, such as lost packets, has its colours, too."""
    pixels = np.concatenate([sample.reshape(-1, 3) for sample in samples]).astype(np.int32)
    packed, counts = np.unique(pixels @ (1 << 16, 1 << 8, 1), return_counts=True)
    # By the roots of their numbers, so that the dark ground does not take all of them.
    repeated = np.repeat(packed, np.ceil(np.sqrt(counts)).astype(int))
    rgb = np.stack([repeated >> shift & 255 for shift in (16, 8, 0)], axis=-1)
    montage = Image.fromarray(rgb[None].astype(np.uint8))
    return montage.quantize(NUM_COLOURS, method=Image.Quantize.MEDIANCUT)


ENCODERS: dict[str, Callable[[Iterable[Picture], Style, Sequence[Picture]], bytes]] = {
    ".mp4": encode_mp4,
    GIF: encode_gif,
}
