# SPDX-License-Identifier: BSD-3-Clause
"""Results of calculations on disk."""
import os
import stat

import numpy as np
import pytest

from world_picture.results import READY, ResultCache


class Counted:
    def __init__(self, result):
        self.result, self.calls = result, 0

    def __call__(self):
        self.calls += 1
        return self.result


@pytest.fixture
def calculate():
    return Counted(np.array([True, False, True]))


def test_a_result_is_calculated_once(tmp_path, calculate):
    for _ in range(3):
        found = ResultCache(tmp_path / "a" / "b").array("sum-1", (np.eye(3), 2.0), calculate)
        assert found.dtype == bool and found.tolist() == [True, False, True]
    assert calculate.calls == 1


def test_another_user_may_read_results_and_a_spare_folder_takes_those_that_are_ready(tmp_path, calculate, monkeypatch):
    ready, spare = tmp_path / "ready" / "results", tmp_path / "bullet_gazebo_results_1000"
    ResultCache(ready).array("sum-1", (1,), calculate)
    assert [stat.S_IMODE(path.stat().st_mode) for path in ready.iterdir()] == [0o644]
    monkeypatch.setenv(READY, str(ready.parent))
    ResultCache(spare).array("sum-1", (1,), calculate)
    assert calculate.calls == 1


def test_what_is_ready_already_is_used_and_stays_as_it_is(tmp_path, calculate, monkeypatch):
    ready, own = tmp_path / "ready" / "results", tmp_path / "own" / "results"
    ResultCache(ready).array("sum-1", (1,), calculate)
    before = set(ready.iterdir())
    monkeypatch.setenv(READY, str(ready.parent))
    assert ResultCache(own).array("sum-1", (1,), calculate).tolist() == [True, False, True] and calculate.calls == 1
    assert not own.exists()
    ResultCache(own).array("sum-1", (2,), calculate)
    assert calculate.calls == 2 and len(list(own.iterdir())) == 1 and set(ready.iterdir()) == before


@pytest.mark.parametrize(("name", "inputs"), [
    ("sum-2", (np.eye(3), 2.0)), ("sum-1", (np.eye(3), 2.5)), ("sum-1", (2.0 * np.eye(3), 2.0)),
    ("sum-1", (np.eye(3),)), ("sum-1", (np.eye(3).reshape(9), 2.0)), ("sum-1", (np.eye(3).astype(np.float32), 2.0)),
])
def test_another_calculation_has_another_result(tmp_path, calculate, name, inputs):
    cache, other = ResultCache(tmp_path), Counted(np.array([7]))
    cache.array("sum-1", (np.eye(3), 2.0), calculate)
    assert cache.array(name, inputs, other).tolist() == [7]


@pytest.mark.parametrize("content", [b"", b"\x93NUMPY", b"not an array", None])
def test_a_damaged_file_is_replaced(tmp_path, calculate, content):
    cache = ResultCache(tmp_path)
    cache.array("sum-1", (), calculate)
    path, = tmp_path.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] if content is None else content)
    assert cache.array("sum-1", (), calculate).tolist() == [True, False, True]
    assert calculate.calls == 2 and path.read_bytes() == whole


def test_those_that_were_used_last_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("world_picture.results.MAX_KEPT", 20)
    cache = ResultCache(tmp_path)
    for number in range(20):
        cache.array("sum-1", (number,), Counted(np.array([number])))
        path = max(tmp_path.iterdir(), key=lambda path: path.stat().st_mtime_ns)
        os.utime(path, (number, number))
    cache.array("sum-1", (0,), pytest.fail)
    cache.array("sum-1", (20,), Counted(np.array([20])))
    assert len(list(tmp_path.iterdir())) == 18
    for number in (0, *range(4, 21)):
        assert cache.array("sum-1", (number,), pytest.fail).tolist() == [number]


def test_without_a_folder_it_is_calculated_each_time(tmp_path, calculate):
    (tmp_path / "file").write_text("")
    cache = ResultCache(tmp_path / "file")
    for _ in range(2):
        assert cache.array("sum-1", (), calculate) is calculate.result
    assert calculate.calls == 2


def test_an_array_that_cannot_be_kept_leaves_no_draft(tmp_path):
    with pytest.raises(ValueError, match="allow_pickle"):
        ResultCache(tmp_path).array("sum-1", (), Counted(np.array([{}], dtype=object)))
    assert list(tmp_path.iterdir()) == []
