# SPDX-License-Identifier: BSD-3-Clause
"""Samples are kept in order, the newest ones only; time that restarts also restarts the curve."""
import threading

import numpy as np
import pytest

from live_plot.recording import RESTART_STEP_S, PlotRecording


def recording_of(label, times, **arguments):
    recording = PlotRecording(**arguments)
    recording.add(label)
    for time_s in times:
        recording.append(label, time_s, 10.0 * time_s)
    return recording


def test_samples_come_back_in_order():
    samples, begin_s = recording_of("a", (5.0, 6.0, 7.0)).samples()
    assert samples["a"].tolist() == [[5.0, 6.0, 7.0], [50.0, 60.0, 70.0]]
    assert begin_s == 5.0


@pytest.mark.parametrize("count", [3, 4, 5, 8, 9, 100])
def test_only_the_newest_are_kept(count):
    samples, _ = recording_of("a", range(count), capacity=4).samples()
    assert samples["a"][0].tolist() == list(range(count))[-4:]


def test_last_seconds_are_those_before_the_newest_of_all_curves():
    recording = recording_of("a", range(10))
    recording.add("b")
    recording.append("b", 12.0, 0.0)
    recording.add("empty")
    samples, begin_s = recording.samples(span_s=5.0)
    assert samples["a"][0].tolist() == [7.0, 8.0, 9.0] and samples["b"][0].tolist() == [12.0]
    assert samples["empty"].size == 0 and begin_s == 0.0


def test_samples_do_not_change_afterwards():
    recording = recording_of("a", range(4), capacity=4)
    samples, _ = recording.samples()
    for time_s in range(4, 20):
        recording.append("a", time_s, 0.0)
    assert samples["a"][0].tolist() == [0.0, 1.0, 2.0, 3.0]


def test_curves_without_samples_are_empty():
    samples, begin_s = recording_of("a", ()).samples()
    assert samples["a"].shape == (2, 0) and begin_s == 0.0


def test_time_begins_with_the_earliest_curve():
    recording = recording_of("a", (5.0, 6.0))
    recording.add("b")
    recording.append("b", 4.0, 0.0)
    recording.add("empty")
    assert recording.samples()[1] == 4.0


def test_simulation_that_starts_again_starts_the_curve_again():
    samples, begin_s = recording_of("a", (100.0, 101.0, 0.5, 0.6)).samples()
    assert samples["a"][0].tolist() == [0.5, 0.6] and begin_s == 0.5


def test_stamps_that_cross_are_kept():
    times = (100.0, 100.0 - 0.9 * RESTART_STEP_S, 100.1)
    assert recording_of("a", times).samples()[0]["a"][0].tolist() == list(times)


def test_late_sample_of_a_removed_curve_is_dropped():
    recording = recording_of("a", (1.0,))
    recording.remove("a")
    recording.remove("a")
    recording.append("a", 2.0, 0.0)
    assert recording.labels == []


def test_clear_keeps_the_curves():
    recording = recording_of("a", (1.0, 2.0))
    recording.clear()
    assert recording.labels == ["a"] and recording.samples()[0]["a"].size == 0


def test_adding_twice_keeps_the_samples():
    recording = recording_of("a", (1.0, 2.0))
    recording.add("a")
    assert recording.samples()[0]["a"].shape == (2, 2)


def test_reader_sees_whole_samples_while_another_thread_writes():
    recording = recording_of("a", (), capacity=50)
    writer = threading.Thread(target=lambda: [recording.append("a", float(k), 10.0 * k) for k in range(20_000)])
    writer.start()
    while writer.is_alive():
        times, values = recording.samples()[0]["a"]
        assert np.array_equal(values, 10.0 * times) and np.all(np.diff(times) == 1.0)
    writer.join()
