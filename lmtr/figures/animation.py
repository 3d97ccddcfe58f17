"""Motions as moving pictures, GIF by Pillow or MP4 by ffmpeg."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageColor
from pydantic import Field

from lmtr.arrays import Array
from lmtr.errors import ConfigurationError
from lmtr.figures.gait_diagram import draw_gait
from lmtr.figures.resample import resampled
from lmtr.figures.scene import Camera, Scene, scene_key
from lmtr.figures.style import FOOT_COLOURS, FORCE, INK, LIMIT_BOX, OBSTACLE, PYRAMID, styled
from lmtr.figures.top_view import require_drawable
from lmtr.robot.model import RobotModel
from lmtr.settings import Settings
from lmtr.trajectory.motion import Motion

FOLLOW_TIME = 1.0
"""The camera follows the base's path averaged over this time (s), so that sway stays visible."""

GAIT_SPAN = 6.0
"""Seconds of gait diagram shown under a longer animation."""

GIF_COLOURS = 96
"""Colours in a GIF's palette: enough for these pictures without dithering, and small."""


class AnimationSettings(Settings):
    """How a motion becomes a moving picture.

    Attributes:
        fps: Pictures per second of viewing. GIF counts time in 1/100 s: the nearest is taken.
        speed: Seconds of motion per second of viewing; below one is slow motion.
        resolution: Pixels per inch; the picture is 7.2 in × 5.8 in.
        azimuth: Direction from the robot to the camera about z, from the world's x (deg).
        elevation: Angle of the camera above the ground (deg).
    """

    fps: Annotated[int, Field(ge=1, le=50)] = 15
    speed: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    resolution: Annotated[int, Field(ge=40, le=300)] = 100
    azimuth: Annotated[float, Field(ge=-360.0, le=360.0)] = -62.0
    elevation: Annotated[float, Field(ge=5.0, le=90.0)] = 24.0


def animate(
    motion: Motion,
    obstacles_W: Array,
    robot: RobotModel,
    path: Path,
    title: str = "",
    settings: AnimationSettings | None = None,
) -> Path:
    """Write a motion as a moving picture; the ending of ``path`` (.gif or .mp4) names its kind.

    Base, feet, forces, friction pyramids, range-of-motion boxes and obstacles, and below them the
    gait diagram with the present time. Between samples the motion is drawn linearly.

    Args:
        motion: A solution, a segment or a rollout.
        obstacles_W: Lines (n, 3): x, y (m) and direction (rad).
        robot: The robot that moves.
        path: File to write.
        title: Headline.
        settings: Rate, speed, size and camera.

    Returns:
        The path.

    Raises:
        ConfigurationError: Another ending, or .mp4 without ffmpeg.
        DataError: The motion has fewer than two samples, or numbers that are not finite.
    """
    require_drawable(motion)
    settings = settings or AnimationSettings()
    write = _writer(path)
    interval = _interval(path, settings.fps)
    film = _Film(motion, interval * settings.speed, obstacles_W, robot, title, settings)
    write(film, path, interval)
    return path


def frame_times(motion: Motion, step: float) -> Array:
    """Times of the pictures (s): every ``step`` from the motion's start, never past its end."""
    start, end = float(motion.times[0]), float(motion.times[-1])
    count = int(np.floor((end - start) / step + 1e-9)) + 1
    return start + step * np.arange(count, dtype=np.float64)


class _Film:
    """Draws the pictures of one motion, one after the other, on the same figure."""

    def __init__(
        self,
        motion: Motion,
        step: float,
        obstacles_W: Array,
        robot: RobotModel,
        title: str,
        settings: AnimationSettings,
    ) -> None:
        self.motion = resampled(motion, frame_times(motion, step))
        self.span = float(motion.times[0]), float(motion.times[-1])
        camera = Camera(settings.azimuth, settings.elevation)
        self.scene = Scene(self.motion, obstacles_W, robot, camera)
        self.centres_W = _smoothed(self.motion.times, self.motion.base_position_W[:, :2])
        self.pace = "" if settings.speed == 1.0 else f", shown at {settings.speed:g}× speed"
        self.resolution = settings.resolution
        self._build(title, motion)

    def __len__(self) -> int:
        return len(self.motion.times)

    @styled
    def _build(self, title: str, motion: Motion) -> None:
        """Lay out view, gait diagram, headline and legend."""
        self.figure = Figure(figsize=(7.2, 5.8), dpi=self.resolution)
        self.canvas = FigureCanvasAgg(self.figure)
        self.view: Axes = self.figure.add_axes((0.0, 0.305, 1.0, 0.65))
        self.gait: Axes = self.figure.add_axes((0.085, 0.195, 0.89, 0.13))
        draw_gait(self.gait, motion)
        self.now = self.gait.axvline(self.span[0], color="black", lw=1.6, zorder=5.0)
        # A headline may take the whole width, and two lines; the clock is below them.
        self.figure.text(0.012, 0.99, title, va="top", weight="bold", size=11, wrap=True)
        self.clock = self.figure.text(0.988, 0.905, "", ha="right", va="top", size=10)
        self.figure.legend(
            handles=scene_key(self.scene.robot),
            loc="lower center",
            ncols=4,
            fontsize=8,
            columnspacing=1.2,
            handlelength=1.6,
            borderaxespad=0.2,
        )

    @styled
    def draw(self, k: int) -> None:
        """Draw picture number ``k``."""
        time = float(self.motion.times[k])
        speed = float(np.linalg.norm(self.motion.base_velocity_W[k, :2]))
        self.view.clear()
        self.scene.draw(self.view, k, self.centres_W[k])
        self.clock.set_text(f"t = {time:.2f} s, {speed:.2f} m/s{self.pace}")
        self.now.set_xdata([time, time])
        start, end = self.span
        width = end - start if end - start < 1.5 * GAIT_SPAN else GAIT_SPAN
        left = float(np.clip(time - width / 2.0, start, end - width))
        self.gait.set_xlim(left, left + width)

    def picture(self, k: int) -> Image.Image:
        """Picture number ``k`` as an RGB image."""
        self.draw(k)
        self.canvas.draw()
        return Image.fromarray(np.asarray(self.canvas.buffer_rgba())[..., :3].copy())


def _smoothed(times: Array, path: Array) -> Array:
    """Path (M, 2) averaged over a sliding window of ``FOLLOW_TIME`` that shrinks at the ends."""
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(path, axis=0)])
    half = np.minimum(FOLLOW_TIME / 2.0, np.minimum(times - times[0], times[-1] - times))
    first = np.searchsorted(times, times - half - 1e-9)
    last = np.searchsorted(times, times + half + 1e-9)
    return np.asarray((total[last] - total[first]) / (last - first)[:, None])


def _interval(path: Path, fps: int) -> float:
    """Time from one picture to the next (s); GIF counts it in 1/100 s, and viewers from 2 on."""
    return max(2, round(100.0 / fps)) / 100.0 if path.suffix == ".gif" else 1.0 / fps


def _writer(path: Path) -> Callable[["_Film", Path, float], None]:
    if path.suffix == ".gif":
        return _write_gif
    if path.suffix != ".mp4":
        raise ConfigurationError(
            f"animation: the file must end in .gif or .mp4, got {path.name!r}; rename it"
        )
    if not FFMpegWriter.isAvailable():
        raise ConfigurationError(
            f"animation: {path.name!r} needs the program ffmpeg, which is not on the PATH; "
            "install it or name a .gif"
        )
    return _write_mp4


def _write_gif(film: "_Film", path: Path, interval: float) -> None:
    """One palette for all pictures and no dithering: no flicker, and small differences."""
    palette = _palette(film.picture(len(film) // 2))
    pictures = (
        film.picture(k).quantize(palette=palette, dither=Image.Dither.NONE)
        for k in range(len(film))
    )
    next(pictures).save(
        path,
        save_all=True,
        append_images=pictures,
        duration=round(1000.0 * interval),
        loop=0,
    )


def _palette(picture: Image.Image) -> Image.Image:
    """An image with a palette for pictures like this one, in which the house colours are exact.

    Median cut gives colours their place by the area they cover, and an arrow covers little.
    """
    house = ("#FFFFFF", *FOOT_COLOURS.values(), FORCE, PYRAMID, LIMIT_BOX, OBSTACLE, INK)
    exact = np.array([ImageColor.getrgb(name) for name in house])
    median_cut = picture.quantize(GIF_COLOURS - len(house)).getpalette("RGB")
    drawn = np.array(median_cut).reshape(-1, 3)
    # Pillow looks colours up coarsely: one that is nearly a house colour would be taken for it.
    apart = np.abs(drawn[:, None] - exact).max(axis=-1).min(axis=-1) > 8
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate([exact, drawn[apart]]).ravel().tolist())
    return palette


def _write_mp4(film: "_Film", path: Path, interval: float) -> None:
    writer = FFMpegWriter(fps=round(1.0 / interval))
    with writer.saving(film.figure, str(path), dpi=film.resolution):
        for k in range(len(film)):
            film.draw(k)
            writer.grab_frame()
