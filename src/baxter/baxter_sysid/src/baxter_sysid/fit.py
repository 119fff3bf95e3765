# SPDX-License-Identifier: BSD-3-Clause
"""Least squares with an answer to what the data determine: numbers, their uncertainty, and blocks of time left out.

Knows nothing of robots. An error is an array (rows, k): rows are moments in time, whose errors belong together for
seconds, so uncertainties are taken over blocks of time (cluster-robust covariance, K.-Y. Liang and S. Zeger, 1986).
"""
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Errors = Callable[[Array], Array]

BLOCKS = 10
MAX_ROUNDS = 16
TRIES = 5
#: By how many of its steps, and by how much of itself, a number is changed where no step makes the cost less.
STEPS, SHARES = (1.0, 3.0), (0.05, 0.15)
#: By how many standard deviations numbers are changed together there.
DEVIATIONS = (1.0, 5.0)
#: A round that makes the cost less by a smaller share is the last one.
ENOUGH = 1e-4
MIN_EIGENVALUE = 1e-9  # of the slopes' correlation


class Fit(NamedTuple):
    """numbers (p,); error (rows, k) with them; slopes (p, rows, k) of the error; deviation (p,): standard deviations of
    the numbers, infinite for those that nothing depends on."""

    numbers: Array
    error: Array
    slopes: Array
    deviation: Array


class FitBounds(NamedTuple):
    """least, most (p,): of the numbers; step (p,): by how much a number is changed to see what follows."""

    least: Array
    most: Array
    step: Array


def least_squares(errors: Errors, start: Array, bounds: FitBounds, rows: NDArray[np.bool_] | None = None,
                  rounds: int = MAX_ROUNDS) -> Fit:
    """The numbers that make the sum of squares of `errors` least (Levenberg-Marquardt); rows: those that count."""
    numbers = np.clip(start, bounds.least, bounds.most)
    error = errors(numbers)
    counts = np.ones(len(error), dtype=bool) if rows is None else rows
    damping, slopes = 1e-3, slopes_of(errors, numbers, error, bounds)
    for _ in range(rounds):
        before = _cost(error[counts])
        for _ in range(TRIES):
            tried = np.clip(numbers - _step(slopes[:, counts], error[counts], damping, _pressed(
                numbers, slopes[:, counts], error[counts], bounds)), bounds.least, bounds.most)
            new = errors(tried)
            if _cost(new[counts]) < before:
                numbers, error, damping = tried, new, max(damping / 10.0, 1e-9)
                break
            damping *= 10.0
        if before - _cost(error[counts]) < ENOUGH * before:
            # Friction makes corners, at which slopes mislead.
            numbers, error = _one_by_one(errors, numbers, error, counts, bounds)
            numbers, error = _along_valleys(errors, numbers, error, slopes, counts, bounds)
            damping = 1e-3
            if before - _cost(error[counts]) < ENOUGH * before:
                break
        slopes = slopes_of(errors, numbers, error, bounds)
    return Fit(numbers, error, slopes, deviations(slopes[:, counts], error[counts]))


def _one_by_one(errors: Errors, numbers: Array, error: Array, counts: NDArray[np.bool_],
                bounds: FitBounds) -> tuple[Array, Array]:
    """Change each number by itself, by steps or by a share of itself, and by twice as much each time, as long as the
    cost becomes less."""
    for index in range(len(numbers)):
        sizes = (*(many * bounds.step[index] for many in STEPS), *(share * abs(numbers[index]) for share in SHARES))
        for by in (sign * size for size in sizes for sign in (1.0, -1.0)):
            while True:
                tried = numbers.copy()
                tried[index] = np.clip(tried[index] + by, bounds.least[index], bounds.most[index])
                new = errors(tried)
                if not _cost(new[counts]) < _cost(error[counts]):
                    break
                numbers, error, by = tried, new, 2.0 * by
    return numbers, error


def _along_valleys(errors: Errors, numbers: Array, error: Array, slopes: Array, counts: NDArray[np.bool_],
                   bounds: FitBounds) -> tuple[Array, Array]:
    """Change the numbers together, along the principal directions of their slopes, by a standard deviation in that
    direction or by several, and by twice as much each time, as long as the cost becomes less. Numbers that make up for
    each other, as the gain and the damping of a joint, move together or not at all."""
    flat = slopes[:, counts].reshape(len(slopes), -1)
    size = np.sqrt(np.einsum("ij,ij->i", flat, flat))
    moves = size > 1e-6
    unit = flat[moves] / size[moves, None]
    values, vectors = np.linalg.eigh(unit @ unit.T)
    noise = np.sqrt(np.mean(error[counts] ** 2))
    for value, vector in zip(values, vectors.T, strict=True):
        if value < MIN_EIGENVALUE:
            continue
        along = np.zeros(len(numbers))
        along[moves] = noise / np.sqrt(value) * vector / size[moves]
        for by in (sign * many for many in DEVIATIONS for sign in (1.0, -1.0)):
            while True:
                tried = np.clip(numbers + by * along, bounds.least, bounds.most)
                new = errors(tried)
                if not _cost(new[counts]) < _cost(error[counts]):
                    break
                numbers, error, by = tried, new, 2.0 * by
    return numbers, error


def slopes_of(errors: Errors, numbers: Array, error: Array, bounds: FitBounds) -> Array:
    """(p, rows, k) how `errors` change with each number."""
    slopes = np.empty((len(numbers), *error.shape))
    for index, step in enumerate(bounds.step):
        changed = numbers.copy()
        # Towards the middle of the bounds.
        changed[index] += step if numbers[index] + step <= bounds.most[index] else -step
        slopes[index] = (errors(changed) - error) / (changed[index] - numbers[index])
    return slopes


def deviations(slopes: Array, error: Array) -> Array:
    """(p,) standard deviations of numbers: slopes (p, rows, k), error (rows, k)."""
    flat = slopes.reshape(len(slopes), -1)
    found = np.full(len(flat), np.inf)
    size = np.sqrt(np.einsum("ij,ij->i", flat, flat))
    moves = size > 1e-6
    if not moves.any():
        return found
    unit = flat[moves] / size[moves, None]
    # A direction in which nothing changes is uncertain, not certain: its eigenvalue is bounded, not left out.
    values, vectors = np.linalg.eigh(unit @ unit.T)
    inverse = (vectors / np.maximum(values, MIN_EIGENVALUE)) @ vectors.T
    unit = unit.reshape(-1, *error.shape)
    blocks = [np.einsum("prk,rk->p", unit[:, block], error[block]) for block in block_slices(len(error))]
    scatter = sum(np.outer(one, one) for one in blocks) * len(blocks) / max(len(blocks) - 1, 1)
    robust = np.diagonal(inverse @ scatter @ inverse)
    # At the best numbers the blocks' sums cancel; with few blocks the plain covariance is the safer bound.
    plain = np.diagonal(inverse) * float(np.mean(error ** 2))
    found[moves] = np.sqrt(np.maximum(robust, plain)) / size[moves]
    return found


def instrumented(errors: Errors, other: Errors, fit: Fit, bounds: FitBounds, steps: int = 4) -> Fit:
    """A fit of a model that has noise of its own, begun at `fit`.

    other: the same errors with the model's noise drawn again. Least squares is biased here, because errors and their
    slopes have the same noise; so errors are made orthogonal to the slopes of `other` (instrumental variables,
    L. Ljung, System Identification, 2nd edition, 1999, section 7.6).
    """
    numbers, error = fit.numbers, errors(fit.numbers)
    slopes = slopes_of(other, numbers, other(numbers), bounds)
    for _ in range(steps):
        numbers = np.clip(numbers - _step(slopes, error, 1e-6, _pressed(numbers, slopes, error, bounds)), bounds.least,
                          bounds.most)
        error = errors(numbers)
    return Fit(numbers, error, slopes, deviations(slopes, error))


def block_slices(rows: int, count: int = BLOCKS) -> list[slice]:
    """`count` blocks of time of equal length."""
    edges = np.linspace(0, rows, count + 1).round().astype(int)
    return [slice(first, last) for first, last in zip(edges[:-1], edges[1:], strict=True)]


def left_out(errors: Errors, fit: Fit, bounds: FitBounds, count: int = BLOCKS, rounds: int = 1) -> Array:
    """(count, rows, k): for each block of time the error with numbers fitted without it; all rows, of which the caller
    takes the block's. A fit begins at `fit` and takes `rounds` steps."""
    found = np.empty((count, *fit.error.shape))
    for index, block in enumerate(block_slices(len(fit.error), count)):
        counts = np.ones(len(fit.error), dtype=bool)
        counts[block] = False
        numbers, error, slopes = fit.numbers, fit.error, fit.slopes
        for number in range(rounds):
            if number:
                slopes = slopes_of(errors, numbers, error, bounds)
            step = _step(slopes[:, counts], error[counts], 1e-6, _pressed(numbers, slopes[:, counts], error[counts],
                                                                          bounds))
            numbers = np.clip(numbers - step, bounds.least, bounds.most)
            error = errors(numbers)
        found[index] = error
    return found


def rms(error: Array) -> Array:
    """(k,) root mean square over rows."""
    return np.sqrt(np.mean(error ** 2, axis=0))


def _cost(error: Array) -> float:
    return float(np.sum(error ** 2))


def _pressed(numbers: Array, slopes: Array, error: Array, bounds: FitBounds) -> NDArray[np.bool_]:
    """(p,) which numbers stand at a bound that the cost presses them against."""
    downhill = -np.einsum("prk,rk->p", slopes, error)
    return ((numbers <= bounds.least) & (downhill < 0.0)) | ((numbers >= bounds.most) & (downhill > 0.0))


def _step(slopes: Array, error: Array, damping: float, pressed: NDArray[np.bool_]) -> Array:
    flat = slopes.reshape(len(slopes), -1)
    normal, gradient = flat @ flat.T, flat @ error.reshape(-1)
    scale = np.diagonal(normal)
    free = (scale > 1e-12) & ~pressed
    step = np.zeros(len(flat))
    if free.any():
        block = normal[np.ix_(free, free)] + damping * np.diag(scale[free])
        step[free] = np.linalg.lstsq(block, gradient[free], rcond=1e-12)[0]
    return step
