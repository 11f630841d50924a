"""Videos as bytes, MP4 that browsers play and GIF: a mission's scene above its mean age."""

import io
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction

import av
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from swarm_mj.replay.footage import Footage
from swarm_mj.replay.links import lifted
from swarm_mj.replay.rendering import drawing
from swarm_mj.replay.rendering.scene import SceneRenderer
from swarm_mj.replay.rendering.theme import THEMES
from swarm_mj.replay.view import CHASE, DEFAULTS, GIF, VideoStyle, fitted

Picture = UInt8[np.ndarray, "H W 3"]

STRIPS = (0.22, 0.28)  # of the height, below one scene, and below two, which are narrow
TEXT = 0.028  # of the height, or of the width of a narrow scene
SEAM = 4  # between scenes [pixels]
LEGEND = 0.32  # of the width; the plot has the rest
QUALITY = "20"  # x264's constant rate factor: no loss is seen
SAMPLES = 8  # pictures that a GIF's colours are taken from
NUM_COLOURS = 255  # of a GIF; the last one is for what does not change


class Movie(ExitStack):
    """The pictures of a video; a context that gives OpenGL's memory back."""

    def __init__(self, footages: Sequence[Footage], style: VideoStyle) -> None:
        """Prepare everything that does not move; raise as `make_video` does."""
        super().__init__()
        if not 1 <= len(footages) <= len(STRIPS):
            raise ValueError(f"a video shows 1 or {len(STRIPS)} missions, not {len(footages)}")
        # One scale for both: by it the fresher team is seen in full, and the other is older still.
        scale = min(each.facts.full_scale for each in footages)
        self._footages = [replace(x, facts=replace(x.facts, full_scale=scale)) for x in footages]
        self._num_frames = style.num_frames
        self._chases = style.camera == CHASE
        width = style.width
        height = style.height
        bottom = height - round(STRIPS[len(footages) - 1] * height)
        edges = np.linspace(0, width, len(footages) + 1).round().astype(int).tolist()
        self._boxes = [drawing.Box(a, 0, b, bottom) for a, b in itertools.pairwise(edges)]
        self._text = max(9, round(min(TEXT * height, 0.05 * self._boxes[0].right)))
        pad = self._text // 2
        middle = pad + round(LEGEND * width)
        top = bottom + pad
        legend = drawing.Box(pad, top, middle - 2 * pad, height - pad)
        right = drawing.Box(middle, top, width - 2 * pad, height - pad)
        theme = self._theme = THEMES[style.theme]
        self._plot = drawing.AgePlot(footages, right, self._text, theme)
        self._empty = Image.new("RGB", (width, height), theme.background)
        draw = ImageDraw.Draw(self._empty)
        drawing.draw_legend(draw, self._footages, legend, self._text, theme)
        self._plot.draw_axes(draw)
        # Two scenes are narrow, and one seen from nearby is full: titles would cover them.
        heights = [drawing.title_height(each, self._text) for each in footages]
        self._scene_top = max(heights) if len(footages) > 1 or self._chases else 0
        with ExitStack() as opened:  # closes the first renderer if the second does not start
            self._renderers: list[SceneRenderer] = []
            for each, box in zip(footages, self._boxes, strict=True):
                renderer = SceneRenderer(
                    each.facts.mission,
                    width=box.right - box.left,
                    height=bottom - self._scene_top,
                    scene=each.scene,
                    theme=theme,
                    camera=style.camera,
                )
                self._renderers.append(opened.enter_context(renderer))
            self.push(opened.pop_all())

    def __iter__(self) -> Iterator[Picture]:
        lengths = [len(each.window) for each in self._footages]
        moments = np.linspace(0, max(lengths) - 1, self._num_frames)
        if not self._chases:  # from nearby, robots that moved once a window would jump
            moments = moments.round()
        for moment in moments.tolist():  # a mission that is over stands still
            yield self.picture([min(moment, length - 1) for length in lengths])

    def picture(self, moments: Sequence[float]) -> Picture:
        """Return the picture of these moments, one of each mission, in windows from 0."""
        rows = [round(moment) for moment in moments]
        picture = self._empty.copy()
        draw = ImageDraw.Draw(picture)
        theme = self._theme
        parts = zip(
            self._footages, moments, self._boxes, self._renderers, theme.curves, strict=False
        )
        for footage, moment, box, renderer, curve in parts:
            row = round(moment)
            scene = Image.fromarray(renderer.frame(footage, moment))
            picture.paste(scene, (box.left, self._scene_top))
            drawing.draw_title(draw, footage, row, box, self._text, curve, theme)
            if self._chases:  # from nearby, most robots are behind the camera or far
                continue
            place_m = lifted(footage.position_m[row], footage.heights_m(row))
            robots = renderer.camera(footage, row).pixels(place_m) + np.array(
                [box.left, self._scene_top]
            )
            drawing.draw_shortfalls(draw, robots, *footage.shortfalls(row), self._text, theme)
        for box in self._boxes[1:]:
            draw.line((box.left, 0, box.left, box.bottom), theme.background, SEAM)
        self._plot.draw_until(draw, rows)
        return np.asarray(picture)


def make_video(
    footages: Sequence[Footage],
    suffix: str = ".mp4",
    style: VideoStyle | None = None,
    on_picture: Callable[[], object] = lambda: None,
) -> bytes:
    """Return the file of a video of one mission, or of two side by side.

    Args:
        footages: One or two logs, such as a `Run`'s, or what `read_footage` reads of replays.
        suffix: `.mp4` or `.gif`.
        style: Size, length and pictures per second; None is 1280 by 720 pixels in 10 seconds.
        on_picture: Called after each picture.

    Returns:
        The file's content.

    Raises:
        ValueError: There are more missions, or the suffix is another.
        OSError: No OpenGL works here; the message says what to install.

    Example:
        ```python
        runs = [swarm_mj.fly("flocking", policy=name) for name in ("planner", "tdma")]
        content = make_video([run.footage() for run in runs])
        Path("both.mp4").write_bytes(content)
        ```
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
        samples = []
        for share in np.linspace(0.0, 1.0, SAMPLES):
            rows = [round(share * (len(each.window) - 1)) for each in footages]
            samples.append(movie.picture(rows))
        return encode_gif(pictures(), style, samples)


def encode_mp4(pictures: Iterable[Picture], style: VideoStyle) -> bytes:
    """Return an H.264 video in the pixel format that every browser plays."""
    content = io.BytesIO()
    with av.open(content, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(style.fps).limit_denominator())
        stream.width = style.width
        stream.height = style.height
        stream.pix_fmt = "yuv420p"  # the only one that all browsers play
        stream.options = {"crf": QUALITY, "preset": "fast"}
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return content.getvalue()


def encode_gif(pictures: Iterable[Picture], style: VideoStyle, samples: Sequence[Picture]) -> bytes:
    """Return a GIF that starts over and over; its colours are those of the samples."""
    pixels = np.concatenate([sample.reshape(-1, 3) for sample in samples]).astype(np.int32)
    packed, counts = np.unique(pixels @ (1 << 16, 1 << 8, 1), return_counts=True)
    # By the roots of their numbers: the dark ground does not take all, and lost packets have one.
    repeated = np.repeat(packed, np.ceil(np.sqrt(counts)).astype(int))
    rgb = np.stack([repeated >> shift & 255 for shift in (16, 8, 0)], axis=-1)
    montage = Image.fromarray(rgb[None].astype(np.uint8))
    colours = montage.quantize(NUM_COLOURS, method=Image.Quantize.MEDIANCUT)
    dither = Image.Dither.NONE
    images = (Image.fromarray(x).quantize(palette=colours, dither=dither) for x in pictures)
    content = io.BytesIO()
    each_ms = round(1000.0 / style.fps)
    next(images).save(content, "gif", save_all=True, append_images=images, duration=each_ms, loop=0)
    return content.getvalue()
