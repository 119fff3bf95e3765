# SPDX-License-Identifier: BSD-3-Clause
"""Large meshes that are simplified in a thread: the caller goes on, and finds them later."""
import threading

import pytest

from bullet_sim.limited_process import LimitedProcess, LimitError
from lab_testing.meshes import sphere
from lab_testing.waiting import wait_until
from world_picture import background, drawing
from world_picture.background import BackgroundDrawings, NotReady

DEADLINE_S = 30.0


class HeldProcess:
    """Simplifies nothing before the test says so; ``failure``: raised instead."""

    def __init__(self):
        self.go_on, self.calls, self.failure = threading.Event(), [], None

    def call(self, function, *arguments):
        self.calls.append(arguments[0])
        assert self.go_on.wait(DEADLINE_S)
        if self.failure is not None:
            raise self.failure
        return function(*arguments)


@pytest.fixture
def process(monkeypatch):
    held = HeldProcess()
    monkeypatch.setattr(background, "LimitedProcess", lambda **limits: held)
    monkeypatch.setattr(background, "LARGE_BYTES", 0)
    yield held
    held.go_on.set()


def ball(path, size):
    vertices, faces = sphere(8)
    lines = ["v %g %g %g" % tuple(size * vertex) for vertex in vertices]
    path.write_text("\n".join(lines + ["f %d %d %d" % tuple(face + 1) for face in faces]) + "\n", encoding="ascii")
    return path


def test_the_caller_goes_on_while_a_mesh_is_simplified(tmp_path, process):
    cache, keys = BackgroundDrawings(tmp_path / "cache"), []
    paths = [ball(tmp_path / ("%d.obj" % number), number) for number in (1, 2)]
    for _ in range(2):
        for path in paths:
            with pytest.raises(NotReady) as caught:
                cache.parts(path)
            keys.append(caught.value.key)
    assert keys[:2] == keys[2:] and cache.is_making(keys[:1]) and cache.is_making(keys)
    process.go_on.set()
    cache.wait(DEADLINE_S)
    assert not cache.is_making(keys)
    assert all(cache.parts(path) for path in paths)
    assert process.calls == [str(path) for path in paths], "each once"


def test_a_smaller_mesh_is_waited_for_and_does_not_wait_for_a_large_one(tmp_path, process, monkeypatch):
    made = []  # the helper for smaller ones comes first
    monkeypatch.setattr(background, "LimitedProcess", lambda **limits: made.append(process) or (
        process if len(made) > 1 else LimitedProcess(**limits)))
    cache, large, small = BackgroundDrawings(tmp_path / "cache", 60.0), tmp_path / "large.obj", tmp_path / "small.obj"
    ball(large, 1).write_text(large.read_text(encoding="ascii") + 1000 * "#\n", encoding="ascii")
    monkeypatch.setattr(background, "LARGE_BYTES", large.stat().st_size)
    with pytest.raises(NotReady) as caught:
        cache.parts(large)
    assert cache.parts(ball(small, 2)) and cache.is_making([caught.value.key])
    assert process.calls in ([], [str(large)])


def test_smaller_meshes_of_a_scene_are_waited_for_no_longer_than_the_patience(tmp_path, process, monkeypatch):
    """On a busy machine the helper gets no processor for minutes; viewers go on, and find the meshes later."""
    monkeypatch.setattr(background, "LARGE_BYTES", 1_000_000)
    now = [0.0]
    cache = BackgroundDrawings(tmp_path / "cache", 10.0, lambda: now[0])
    now[0] = 10.0
    for number in (1, 2):
        with pytest.raises(NotReady):
            cache.parts(ball(tmp_path / ("%d.obj" % number), number))
    process.go_on.set()
    cache.begin_scene()
    assert cache.parts(tmp_path / "1.obj") and cache.parts(tmp_path / "2.obj")


def test_waiting_has_an_end(tmp_path, process):
    cache = BackgroundDrawings(tmp_path / "cache")
    with pytest.raises(NotReady) as caught:
        cache.parts(ball(tmp_path / "1.obj", 1))
    cache.wait(0.01)
    assert cache.is_making([caught.value.key])


@pytest.mark.parametrize("failure", [LimitError("it took too long"), OSError("no space left"),
                                     ZeroDivisionError("an error that nobody foresaw")])
def test_a_mesh_that_cannot_be_used_is_not_tried_again(tmp_path, process, failure):
    cache, process.failure = BackgroundDrawings(tmp_path / "cache"), failure
    path = ball(tmp_path / "1.obj", 1)
    process.go_on.set()
    with pytest.raises(NotReady):
        cache.parts(path)
    cache.wait(DEADLINE_S)
    for _ in range(2):
        with pytest.raises(drawing.DrawingError, match=str(failure)):
            cache.parts(path)
    assert len(process.calls) == 1
    process.failure = None
    ball(path, 2)
    wait_until(lambda: not _is_not_ready(cache, path), "another file", DEADLINE_S)


def test_a_drawing_that_was_removed_is_made_again(tmp_path, process):
    cache, path = BackgroundDrawings(tmp_path / "cache"), ball(tmp_path / "1.obj", 1)
    process.go_on.set()
    for calls in (1, 2):
        with pytest.raises(NotReady):
            cache.parts(path)
        cache.wait(DEADLINE_S)
        assert cache.parts(path) and len(process.calls) == calls
        next((tmp_path / "cache").glob("*/parts.json")).unlink()


def _is_not_ready(cache, path):
    try:
        cache.parts(path)
    except NotReady:
        return True
    return False
