# SPDX-License-Identifier: BSD-3-Clause
"""The drawing thread: follows snapshots across restarts, draws what changes, repeats pulls; clock and pace."""
import contextlib

import numpy as np
import pytest
from window_worlds import BLOCK_AT, SCENE, snapshot, values

from lab_testing.waiting import wait_until
from sensor_renderer.best import best_renderer
from world_picture.shared_picture import PictureWriter
from world_window.clock import Clock
from world_window.sharpness import GOAL_S, SCALES, Sharpness
from world_window.stage import LEFT, WindowStage
from world_window.viewer import Viewer

DEADLINE_S = 30.0


class Watched:
    """A viewer with everything that it hands over."""

    def __init__(self, folder):
        self.folder, self.frames, self.pulls, self.warnings = folder, [], [], []
        self.viewer = Viewer(lambda: self.folder, lambda: best_renderer()[0], self.frames.append, self.pulls.append,
                             self.warnings.append)

    def pictures(self):
        return [frame for frame in list(self.frames) if frame.pixels is not None]

    def wait(self, condition, what):
        return wait_until(condition, what, DEADLINE_S, 0.01)


@contextlib.contextmanager
def watched(folder, size=(320, 240)):
    seen = Watched(folder)
    seen.viewer.post(WindowStage.resize, *size)
    seen.viewer.start()
    try:
        yield seen
    finally:
        seen.viewer.end()
        assert not seen.viewer.is_alive()


def red(pixels):
    return np.nonzero((pixels[..., 0] > 90) & (pixels[..., 1:].max(axis=-1) < 60))


def test_pictures_follow_the_world(tmp_path):
    with snapshot(tmp_path) as simulator, watched(simulator.folder) as seen:
        seen.wait(lambda: seen.pictures(), "a picture")
        first = seen.pictures()[-1]
        assert first.pixels.shape == (240, 320, 3) and len(red(first.pixels)[0]) > 30
        assert list(first.models) == [entry["name"] for entry in SCENE] and list(first.models["arm"]) == ["foot", "rod"]
        simulator.write(1, 0.5, [values(np.add(BLOCK_AT, (0.0, 0.0, 0.2)))])
        row = red(first.pixels)[0].mean()
        seen.wait(lambda: red(seen.pictures()[-1].pixels)[0].mean() < row - 5, "the block higher")
        assert seen.frames[-1].clock[:2] == (0.5, False)
        simulator.write(2, 0.5, [values()], paused=True)
        seen.wait(lambda: seen.frames[-1].clock[1], "a pause")
        assert not seen.warnings


def test_a_world_at_rest_is_not_drawn_again(tmp_path):
    with snapshot(tmp_path) as simulator, watched(simulator.folder) as seen:
        seen.wait(lambda: seen.pictures(), "a picture")
        before, ticks = len(seen.pictures()), 0
        told = len(seen.frames)
        while len(seen.frames) < told + 5:  # the clock goes on
            ticks += 1
            simulator.write(ticks, 0.01 * ticks, [values()])
            seen.wait(lambda now=0.01 * ticks: seen.frames[-1].clock[0] == pytest.approx(now), "the time")
        assert len(seen.pictures()) == before
        seen.viewer.post(WindowStage.show, "names", True)
        seen.wait(lambda: len(seen.pictures()) > before, "another picture")
        assert seen.pictures()[-1].shapes


@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_a_screen_is_drawn_again_when_its_picture_changes(tmp_path, turned):
    """Also one that shows the viewer its back, whose picture is not read."""
    picture = PictureWriter(tmp_path / "screen1", 4, 4)
    shown = {"link": "top", "offset": [0, -1, 0, 0, 0, 0, turned, 0, -turned, 0, 0, 0.5, 0, 0, 0, 1],
             "size": (0.5, 0.5), "picture": str(picture.path)}
    scene = [{**entry, "screens": [shown]} if entry["name"] == "table" else entry for entry in SCENE]
    with snapshot(tmp_path, scene) as simulator, watched(simulator.folder) as seen:
        seen.wait(lambda: seen.pictures(), "a picture")
        told, count = len(seen.frames), len(seen.pictures())
        seen.wait(lambda: len(seen.frames) > told + 3, "further frames")
        assert len(seen.pictures()) == count
        picture.show(np.full((4, 4, 3), 255, np.uint8))
        seen.wait(lambda: len(seen.pictures()) > count, "another picture")


def test_a_hidden_window_draws_nothing(tmp_path):
    with snapshot(tmp_path) as simulator, watched(simulator.folder) as seen:
        seen.wait(lambda: seen.pictures(), "a picture")
        seen.viewer.set_visible(False)
        simulator.write(1, 7.0, [values(np.add(BLOCK_AT, 0.1))])
        seen.wait(lambda: seen.frames[-1].clock[0] == 7.0, "the time")
        told, count = len(seen.frames), len(seen.pictures())
        seen.wait(lambda: len(seen.frames) > told + 2, "further frames")
        assert len(seen.pictures()) == count
        seen.viewer.set_visible(True)
        seen.wait(lambda: len(seen.pictures()) > count, "a picture again")


def test_a_restarted_simulator_is_found(tmp_path):
    with watched(None) as seen:
        seen.wait(lambda: seen.frames, "a frame without a simulator")
        assert seen.frames[-1].clock is None and seen.frames[-1].pixels is None
        with snapshot(tmp_path) as simulator:
            seen.folder = str(simulator.folder)
            seen.wait(lambda: seen.pictures(), "the first simulator's picture")
        seen.wait(lambda: seen.frames[-1].clock is None, "its end")
        count = len(seen.pictures())
        with snapshot(tmp_path) as simulator:
            seen.folder = str(simulator.folder)
            seen.wait(lambda: len(seen.pictures()) > count, "the second simulator's picture")
    assert not seen.warnings


def test_a_pull_is_repeated_until_it_ends(tmp_path):
    with snapshot(tmp_path) as simulator, watched(simulator.folder) as seen:
        seen.wait(lambda: seen.pictures(), "a picture")

        def press(stage):
            local = np.linalg.inv(stage.eye.pose()) @ [*BLOCK_AT, 1.0]
            stage.press(LEFT, *stage.pinhole.project([local[:3]])[0], control=True)

        seen.viewer.post(press)
        seen.wait(lambda: len(seen.pulls) > 3, "repeated pulls")
        assert (seen.pulls[0].model, seen.pulls[0].link) == ("block", "body")
        seen.viewer.post(WindowStage.let_go)
        seen.wait(lambda: seen.pulls[-1] is None, "the end of the pull")


def test_a_pull_ends_with_the_simulator(tmp_path):
    with watched(None) as seen:
        with snapshot(tmp_path) as simulator:
            seen.folder = str(simulator.folder)
            seen.wait(lambda: seen.pictures(), "a picture")
            seen.viewer.post(lambda stage: setattr(stage, "pull", stage.pull or _a_pull()))
            seen.wait(lambda: seen.pulls, "a pull")
        seen.wait(lambda: seen.pulls[-1] is None, "its end")


def _a_pull():
    from world_window.stage import Pull

    return Pull("block", "body", np.zeros(3), np.ones(3))


def test_the_clock_measures_the_last_second():
    clock = Clock()
    for tick in range(30):
        clock.take(0.5 * tick * 0.1, False, 100.0 + tick * 0.1)
    assert clock.factor == pytest.approx(0.5) and clock.simulated_s == pytest.approx(1.45)
    for tick in range(30, 45):
        clock.take(1.5 + (tick - 30) * 0.2, False, 100.0 + tick * 0.1)
    assert clock.factor == pytest.approx(2.0, rel=0.05)
    clock.take(4.3, True, 105.0)
    assert clock.paused and clock.factor is None
    clock.take(4.4, False, 200.0)
    assert clock.factor is None  # the pause does not count
    for tick in range(10):
        clock.take(4.5 + 0.1 * tick, False, 200.1 + 0.1 * tick)
    assert clock.factor == pytest.approx(1.0)
    clock.take(0.0, False, 201.2)
    assert clock.factor is None  # a reset does not either


@pytest.mark.parametrize("pixels, smallest", [(1000 * 680, 0.5), (1920 * 1040, 0.375), (3840 * 2080, 0.25)])
def test_slow_pictures_get_smaller_and_quick_ones_larger_again(pixels, smallest):
    sharpness = Sharpness()
    for _ in range(2):
        sharpness.take(2.0 * GOAL_S, pixels)
    sharpness.take(0.9 * GOAL_S, pixels)
    assert sharpness.scale == SCALES[0]  # single ones do not count
    for _ in range(20):
        sharpness.take(2.0 * GOAL_S, pixels)
    assert sharpness.scale == smallest
    for _ in range(100):
        sharpness.take(0.5 * GOAL_S, pixels)  # larger ones would take too long
    assert sharpness.scale == smallest
    for _ in range(100):
        sharpness.take(0.1 * GOAL_S, pixels)
    assert sharpness.scale == SCALES[0]


def test_a_window_that_gets_small_keeps_half_of_its_pixels():
    sharpness = Sharpness()
    for _ in range(20):
        sharpness.take(2.0 * GOAL_S, 3840 * 2080)
    sharpness.take(2.0 * GOAL_S, 1000 * 680)
    assert sharpness.scale == 0.5


def test_a_picture_of_few_pixels_is_sharp_at_rest(tmp_path):
    with snapshot(tmp_path) as simulator, watched(simulator.folder) as seen:
        seen.wait(lambda: seen.pictures(), "a picture")
        seen.viewer.post(lambda stage: setattr(seen.viewer._sharpness, "scale", 0.5))
        simulator.write(1, 0.1, [values(np.add(BLOCK_AT, 0.1))])
        seen.wait(lambda: seen.pictures()[-1].pixels.shape == (120, 160, 3), "a small picture")
        seen.wait(lambda: seen.pictures()[-1].pixels.shape == (240, 320, 3), "a sharp one")
