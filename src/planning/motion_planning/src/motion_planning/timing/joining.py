# SPDX-License-Identifier: BSD-3-Clause
"""From one trajectory to another while the joints move.

The first motion comes to rest on its own path, the second one begins at rest there. Their sum with the second one begun
earlier is a motion without a stop, with continuous velocities and accelerations.
"""
from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from motion_planning.timing.timed import Timed

# Time in which braking builds up and fades [s]; durations on the path that are tried: each is so much longer than the
# one before.
_RAMP_S, _LONGER = 0.1, 1.15
# Distance of a joined trajectory's points [s], and of the first one from its start: the controller leads there from
# where the joints really are.
_STEP_S, LEAD_S = 0.04, 0.1
# Shares of the time of braking by which the second motion begins earlier.
_OVERLAPS = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25, 0.1)


def brakings(timed: Timed, begin: float, acceleration: np.ndarray) -> list[Timed]:
    """Return Timeds that continue ``timed`` from its time ``begin`` [s] on, with its velocity and acceleration, and
    come to rest as soon as the limits acceleration (k,) allow: one on its path, if that takes hardly longer than the
    other one, which goes straight on where the path turns.
    """
    q, v, a = (part[0] for part in timed.sampled([begin]))
    straight = _straight_on(q, v, a, acceleration)
    duration = 2.0 * _RAMP_S
    while duration < min(_LONGER * straight.duration, timed.duration - begin):
        found = _slowing(timed, begin, duration)
        if (np.abs(found.accelerations) <= acceleration).all():
            return [found, straight]
        duration *= _LONGER
    return [straight]


def _moments(duration: float) -> np.ndarray:
    return np.linspace(0.0, duration, max(5, 1 + int(np.ceil(duration / (0.5 * _STEP_S)))))


def _trapezium(times: np.ndarray, duration: float) -> np.ndarray:
    """Of a function that rises from 0 to 1 within the ramp's time, stays and falls to 0 at ``duration``: its values,
    its integral and the integral of that at ``times`` (n,)."""
    def ramp(t: np.ndarray) -> np.ndarray:
        inside = np.clip(t, 0.0, _RAMP_S)
        late = np.maximum(t - _RAMP_S, 0.0)
        return np.array([inside / _RAMP_S, inside**2 / (2.0 * _RAMP_S) + late,
                         inside**3 / (6.0 * _RAMP_S) + 0.5 * _RAMP_S * late + 0.5 * late**2])

    return ramp(times) - ramp(times - (duration - _RAMP_S))


def _slowing(timed: Timed, begin: float, duration: float) -> Timed:
    """On the path: its speed falls from 1 to 0."""
    times = _moments(duration)
    falls, fallen, behind = _trapezium(times, duration)[:, :, None] / (duration - _RAMP_S)
    q, v, a = timed.sampled(begin + times - behind[:, 0])
    return Timed(times, q, v * (1.0 - fallen), a * (1.0 - fallen) ** 2 - v * falls)


def _straight_on(q: np.ndarray, v: np.ndarray, a: np.ndarray, limit: np.ndarray) -> Timed:
    """From the state ``q``, ``v``, ``a`` to rest: the acceleration fades within the ramp's time, and as it does, that
    of braking builds up."""
    faded = v + 0.5 * _RAMP_S * a
    duration = 2.0 * _RAMP_S + max(0.0, float((np.abs(faded) / limit).max()) - _RAMP_S)
    times = _moments(duration)
    t = np.minimum(times, _RAMP_S)[:, None]
    fading = 1.0 - t / _RAMP_S
    falls, fallen, behind = _trapezium(times, duration)[:, :, None] / (duration - _RAMP_S)
    late = np.maximum(times[:, None] - _RAMP_S, 0.0)
    way = v * times[:, None] + a * (t**2 / 2.0 - t**3 / (6.0 * _RAMP_S) + 0.5 * _RAMP_S * late)
    return Timed(times, q + way - faded * behind, v + a * (t - t**2 / (2.0 * _RAMP_S)) - faded * fallen,
                 a * fading - faded * falls)


def joined(first: Timed, second: Timed, overlap: float) -> Timed:
    """Return the Timed of ``first``, which ends at rest where ``second`` begins at rest, and of ``second``, begun
    ``overlap`` [s] before that; at most as long as the shorter of the two. Its second point is LEAD_S after its first
    one, or it has one point behind that."""
    later = first.duration - overlap
    end = later + second.duration
    times = np.concatenate([np.arange(LEAD_S, first.duration, _STEP_S), later + second.times])
    times = np.unique(np.round(times[(times > LEAD_S - 1e-9) & (times < end - 1e-6)], 6))
    times = np.concatenate([[0.0], times[np.append(np.diff(times) > 1e-3, [True] * bool(len(times)))], [end]])
    parts = [a + b for a, b in zip(first.sampled(times), second.sampled(times - later), strict=True)]
    return Timed(times, parts[0] - second.positions[0], *parts[1:])


def led(timed: Timed) -> Timed:
    """Return ``timed`` with its second point LEAD_S after its first one, or at its end if that is sooner."""
    times = np.arange(LEAD_S, timed.duration - 0.5 * _STEP_S, _STEP_S)
    times = np.concatenate([[0.0], times, [timed.duration]])
    return Timed(times, *timed.sampled(times))


def joinings(first: Timed, second: Timed, velocity: np.ndarray,
             acceleration: np.ndarray) -> Iterator[tuple[float, Timed]]:
    """Yield (overlap [s], ``joined`` with it) from the longest overlap that keeps to the limits (k,) of velocity and
    acceleration to none."""
    for share in _OVERLAPS:
        overlap = share * min(first.duration, second.duration)
        found = joined(first, second, overlap)
        speeds, accelerations = found.peaks()
        if (speeds <= velocity).all() and (accelerations <= acceleration).all():
            yield overlap, found
    yield 0.0, joined(first, second, 0.0)
