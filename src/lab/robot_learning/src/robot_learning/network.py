# SPDX-License-Identifier: BSD-3-Clause
"""A network of layers with rectifiers, and Adam, in NumPy."""
from __future__ import annotations

import os
from collections.abc import Callable, Sequence

import numpy as np

_THREADS = "OPENBLAS_NUM_THREADS"


def _fast_product() -> Callable[..., np.ndarray] | None:
    """sgemm of SciPy's wheels, or None where there is none. Debian's own NumPy multiplies ten times as slowly.

    With one thread: several wait for each other busily, which costs twelve times the processor time where other
    programs run as well (2026-11-30: 47 ms a step of training, with one thread 4 ms). The library reads the variable
    when it is loaded."""
    before = os.environ.get(_THREADS)
    os.environ.setdefault(_THREADS, "1")
    try:
        from scipy.linalg.blas import sgemm  # pyright: ignore[reportAttributeAccessIssue]  (compiled)
    except ImportError:
        return None
    finally:
        if before is None:
            del os.environ[_THREADS]
    return sgemm


sgemm = _fast_product()

_FIRST, _SECOND, _EPSILON = 0.9, 0.999, 1e-8


def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n, k) of (n, m) and (m, k), all float32."""
    return first @ second if sgemm is None else sgemm(1.0, second.T, first.T).T


class Network:
    """layers: [(weights (n, m), offsets (m,))], float32; all but the last are followed by a rectifier."""

    def __init__(self, layers: Sequence[tuple[np.ndarray, np.ndarray]]):
        self.layers = [(np.asarray(weights, np.float32), np.asarray(offsets, np.float32))
                       for weights, offsets in layers]

    @classmethod
    def random(cls, sizes: Sequence[int], random: np.random.Generator) -> Network:
        """sizes: of inputs, hidden layers and outputs. Initial weights as He et al. (2015), the last ones small."""
        layers = []
        for index, (before, after) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
            scale = np.sqrt(2.0 / before) * (0.1 if index == len(sizes) - 2 else 1.0)
            layers.append((scale * random.standard_normal((before, after)), np.zeros(after)))
        return cls(layers)

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """(frames, outputs) of (frames, inputs)."""
        for weights, offsets in self.layers[:-1]:
            inputs = np.maximum(product(inputs, weights) + offsets, 0.0)
        weights, offsets = self.layers[-1]
        return product(inputs, weights) + offsets

    def gradients(self, inputs: np.ndarray, wanted: np.ndarray, share: np.ndarray) -> tuple[float, list[np.ndarray]]:
        """The loss, mean of share * (output - wanted)^2, and its gradients for weights and offsets in turn.
        share: (frames, outputs)."""
        values = [inputs]
        for weights, offsets in self.layers[:-1]:
            values.append(np.maximum(product(values[-1], weights) + offsets, 0.0))
        weights, offsets = self.layers[-1]
        off = product(values[-1], weights) + offsets - wanted
        back = share * off
        loss = float(np.mean(back * off))
        back *= 2.0 / off.size
        found: list[np.ndarray] = []
        for index in range(len(self.layers) - 1, -1, -1):
            found[:0] = [product(values[index].T, back), back.sum(axis=0)]
            if index:
                back = product(back, self.layers[index][0].T) * (values[index] > 0.0)
        return loss, found


class Adam:
    """Kingma and Ba (2015), with weights that decay apart from the gradient (Loshchilov and Hutter, 2019)."""

    def __init__(self, network: Network, decay: float):
        self._values = [array for layer in network.layers for array in layer]
        self._decay, self._count = decay, 0
        self._mean = [np.zeros_like(value) for value in self._values]
        self._square = [np.zeros_like(value) for value in self._values]

    def step(self, gradients: Sequence[np.ndarray], rate: float) -> None:
        """Change the network's weights in place. rate: of learning."""
        self._count += 1
        rate_now = np.float32(rate * np.sqrt(1.0 - _SECOND**self._count) / (1.0 - _FIRST**self._count))
        for value, mean, square, gradient in zip(self._values, self._mean, self._square, gradients, strict=True):
            mean += np.float32(1.0 - _FIRST) * (gradient - mean)
            square += np.float32(1.0 - _SECOND) * (gradient * gradient - square)
            if value.ndim == 2:
                value *= np.float32(1.0 - rate * self._decay)
            value -= rate_now * mean / (np.sqrt(square) + np.float32(_EPSILON))
