# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of a set as LeRobot has them: of each episode, and joined over all.

Of a feature: min, max, mean, std (of the population), count, and quantiles 1, 10, 50, 90, 99 %, each a list;
pictures have them for each colour, as shares of full brightness, in lists [3][1][1].
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
NAMES = ("min", "max", "mean", "std", "count", *QUANTILES)
#: Pictures with a longer side are thinned to about half of this.
_FULL_SIDE = 300
_LEVELS = 256
Statistics = dict[str, np.ndarray]


def of_numbers(values: np.ndarray) -> Statistics:
    """Of (frames, n) numbers; each an (n,), count (1,)."""
    values = np.asarray(values, dtype=float)
    levels = np.quantile(values, list(QUANTILES.values()), axis=0)
    return {"min": values.min(axis=0), "max": values.max(axis=0), "mean": values.mean(axis=0),
            "std": values.std(axis=0),
            "count": np.array([len(values)]),
            **dict(zip(QUANTILES, levels, strict=True))}


class PictureStatistics:
    """Counts the brightnesses of pictures as they come. `add` takes (height, width, 3) uint8."""

    def __init__(self) -> None:
        self._counts = np.zeros((3, _LEVELS), dtype=np.int64)
        self._pictures = 0

    def add(self, pixels: np.ndarray) -> None:
        """Count one picture."""
        longer = max(pixels.shape[:2])
        thin = max(2 * longer // _FULL_SIDE, 1) if longer >= _FULL_SIDE else 1
        for channel in range(3):
            self._counts[channel] += np.bincount(pixels[::thin, ::thin, channel].ravel(), minlength=_LEVELS)
        self._pictures += 1

    def result(self) -> Statistics:
        """Of all pictures; each a (3, 1, 1), count (1,)."""
        share = np.arange(_LEVELS) / (_LEVELS - 1)
        total = self._counts.sum(axis=1)
        mean = self._counts @ share / total
        variance = self._counts @ share**2 / total - mean**2
        below = np.cumsum(self._counts, axis=1)
        at = {name: share[[int(np.searchsorted(row, part * row[-1])) for row in below]]
              for name, part in {"min": 1e-12, **QUANTILES, "max": 1.0}.items()}
        at.update(mean=mean, std=np.sqrt(np.maximum(variance, 0.0)))
        return {"count": np.array([self._pictures]), **{name: value.reshape(3, 1, 1) for name, value in at.items()}}


def joined(parts: Sequence[Statistics]) -> Statistics:
    """Of all episodes together: means weighted by counts, the parallel formula of variances, quantiles as the weighted
    mean of the episodes' quantiles."""
    counts = np.array([float(part["count"][0]) for part in parts])
    weights = counts / counts.sum()

    def weighted(values):
        return np.tensordot(weights, np.stack(values), 1)

    mean = weighted([part["mean"] for part in parts])
    variance = weighted([part["std"]**2 + (part["mean"] - mean)**2 for part in parts])
    return {"min": np.min([part["min"] for part in parts], axis=0),
            "max": np.max([part["max"] for part in parts], axis=0), "mean": mean, "std": np.sqrt(variance),
            "count": np.array([int(counts.sum())]),
            **{name: weighted([part[name] for part in parts]) for name in QUANTILES}}


def as_lists(statistics: Mapping[str, Statistics]) -> dict[str, dict[str, Any]]:
    """As JSON holds them."""
    return {key: {name: part[name].tolist() for name in NAMES} for key, part in statistics.items()}


def from_lists(statistics: Mapping[str, Mapping[str, Any]]) -> dict[str, Statistics]:
    """The reverse of `as_lists`."""
    return {key: {name: np.asarray(value) for name, value in part.items()} for key, part in statistics.items()}
