"""Animations: pictures, time, kinds of files."""

import stat
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from lmtr.errors import ConfigurationError
from lmtr.expert.initial_guess import initial_guess
from lmtr.expert.settings import Scope
from lmtr.figures.animation import AnimationSettings, animate, frame_times
from lmtr.robot.model import ANYMAL
from lmtr.streams import Purpose, stream
from lmtr.task.sampling import TaskDistribution, sample_noise, sample_task
from lmtr.trajectory.motion import sampled

SMALL = AnimationSettings(fps=5, resolution=40)


@pytest.fixture(scope="module")
def walk():
    """A short noisy walk and its obstacles."""
    distribution = TaskDistribution(goal_distance=(0.5, 0.6))
    rng = stream(5, Purpose.TASK, 0)
    task, scope = sample_task(distribution, ANYMAL, rng), Scope(duration=2.0, n_swings=1)
    noise = sample_noise(distribution, scope.n_swings, rng)
    guess = initial_guess(task, noise, ANYMAL, scope)
    return sampled(guess.trajectory, 0.05), task.obstacles_W


def test_gif_has_one_picture_per_time_step_and_plays_in_true_time(walk, tmp_path):
    motion, lines = walk
    path = animate(motion, lines, ANYMAL, tmp_path / "walk.gif", "Walk", SMALL)
    with Image.open(path) as film:
        assert film.n_frames == 11  # 2 s at 5 pictures per second, both ends shown
        assert film.size == (288, 232)
        assert film.info["duration"] == 200
        pictures = []
        for k in range(film.n_frames):
            film.seek(k)
            pictures.append(np.asarray(film.convert("RGB"), dtype=int))
    assert (pictures[0][0, 0] == 255).all()  # a pure white page
    changes = [np.abs(b - a).sum() for a, b in pairwise(pictures)]
    assert min(changes) > 0


def test_rate_that_gif_cannot_tell_is_rounded_without_changing_the_speed(walk, tmp_path):
    motion, lines = walk
    settings = AnimationSettings(fps=15, resolution=40)
    path = animate(motion, lines, ANYMAL, tmp_path / "walk.gif", settings=settings)
    with Image.open(path) as film:
        assert film.info["duration"] == 70
        assert film.n_frames == len(frame_times(motion, 0.07))


def test_slow_motion_has_more_pictures(walk):
    motion, _ = walk
    assert len(frame_times(motion, 0.1)) == 21
    assert len(frame_times(motion, 0.05)) == 41
    assert frame_times(motion, 0.3)[-1] == pytest.approx(1.8)


def test_forces_are_red_while_feet_stand(walk, tmp_path):
    motion, lines = walk
    path = animate(motion, lines, ANYMAL, tmp_path / "walk.gif", settings=SMALL)
    bare = animate(
        type(motion)(**{**vars(motion), "foot_force_W": 0.0 * motion.foot_force_W}),
        lines,
        ANYMAL,
        tmp_path / "bare.gif",
        settings=SMALL,
    )

    def red(film_path):
        with Image.open(film_path) as film:
            pixels = np.asarray(film.convert("RGB"), dtype=int)
        return int(((pixels[..., 0] > 160) & (pixels[..., 1:] < 70).all(axis=-1)).sum())

    assert red(path) > red(bare) + 10


def test_a_long_headline_leaves_the_clock_readable(walk, tmp_path):
    motion, lines = walk
    title = "Rollout 12 of evaluation-0123456789ab on course 3, seed 1: LMTR-32-vicinity, diverged"

    def clock(name, headline):
        path = animate(motion, lines, ANYMAL, tmp_path / name, headline, AnimationSettings(fps=5))
        with Image.open(path) as film:
            page = np.asarray(film.convert("L"))
        assert (page[:54, -4:] == 255).all()  # nothing runs off the page
        return page[54:72, 540:]

    alone, beside = clock("short.gif", ""), clock("long.gif", title)
    assert (alone < 128).sum() > 100
    # Each film has a palette of its own, which moves single grey pixels over the threshold.
    assert ((alone < 128) != (beside < 128)).mean() < 0.01


def test_other_endings_and_missing_ffmpeg_are_refused(walk, tmp_path, monkeypatch):
    motion, lines = walk
    with pytest.raises(ConfigurationError, match=r"\.gif or \.mp4, got 'walk\.avi'"):
        animate(motion, lines, ANYMAL, tmp_path / "walk.avi")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ConfigurationError, match=r"ffmpeg.*name a \.gif"):
        animate(motion, lines, ANYMAL, tmp_path / "walk.mp4")
    assert not list(tmp_path.iterdir())


def test_mp4_pipes_every_picture_to_ffmpeg(walk, tmp_path, monkeypatch):
    motion, lines = walk
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\nexec /bin/cat > "$last"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(tmp_path))
    path = animate(motion, lines, ANYMAL, tmp_path / "walk.mp4", settings=SMALL)
    width, height, bytes_per_pixel = 288, 232, 4
    assert path.stat().st_size == 11 * width * height * bytes_per_pixel
