# SPDX-License-Identifier: BSD-3-Clause
"""Samples of several curves, written by one thread and read by another. Knows neither ROS nor Qt."""
from __future__ import annotations

import threading

import numpy as np

# 20 minutes at 50 Hz.
CAPACITY = 60_000
# Stamps of several publishers may be out of order by less; a larger step back means a restarted simulation.
RESTART_STEP_S = 1.0


class _Series:
    """The last `capacity` samples, in order. The array is twice as long, so that data is rarely moved."""

    def __init__(self, capacity: int) -> None:
        self._data = np.empty((2, 2 * capacity))
        self._capacity = capacity
        self._end = 0

    def append(self, time_s: float, value: float) -> None:
        if self._end and time_s < self._data[0, self._end - 1] - RESTART_STEP_S:
            self._end = 0
        if self._end == self._data.shape[1]:
            self._data[:, :self._capacity] = self._data[:, self._capacity:]
            self._end = self._capacity
        self._data[:, self._end] = time_s, value
        self._end += 1

    def kept(self) -> np.ndarray:
        """A view, for the holder of the lock: (2, n), times and values."""
        return self._data[:, max(0, self._end - self._capacity):self._end]


class PlotRecording:
    """Curves by label. Times are in s, on whatever clock the writer uses."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._capacity = capacity
        self._series = {}
        self._lock = threading.Lock()

    @property
    def labels(self) -> list[str]:
        with self._lock:
            return list(self._series)

    def add(self, label: str) -> None:
        with self._lock:
            self._series.setdefault(label, _Series(self._capacity))

    def remove(self, label: str) -> None:
        with self._lock:
            self._series.pop(label, None)

    def clear(self) -> None:
        """Forget all samples; the curves stay."""
        with self._lock:
            self._series = {label: _Series(self._capacity) for label in self._series}

    def append(self, label: str, time_s: float, value: float) -> None:
        """Add a sample; a sample of a removed curve is dropped.

        A time that jumps back by more than RESTART_STEP_S restarts the curve.
        """
        with self._lock:
            if label in self._series:
                self._series[label].append(time_s, value)

    def samples(self, span_s: float | None = None) -> tuple[dict[str, np.ndarray], float]:
        """Return {label: (2, n) array, times and values}, and the earliest time kept, from which a graph may count [s].

        span_s: return only those that are at most so much older than the newest of all curves [s].
        """
        with self._lock:
            kept = {label: series.kept() for label, series in self._series.items()}
            filled = [part[0] for part in kept.values() if part.size]
            begin_s = min((times[0] for times in filled), default=0.0)
            if span_s is not None and filled:
                oldest_s = max(times[-1] for times in filled) - span_s
                kept = {label: part[:, np.searchsorted(part[0], oldest_s):] for label, part in kept.items()}
            return {label: part.copy() for label, part in kept.items()}, begin_s
