# SPDX-License-Identifier: BSD-3-Clause
"""The learning curve as a picture, and a film of episodes side by side."""
from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from demonstrations.films import Film
from demonstrations.layout import write_whole
from gym_baxter.core import Core

from .evaluation import Score, play
from .policy import Acting
from .training import LossCurve

_SIZE, _LEFT, _TOP, _RIGHT, _BOTTOM = (720, 420), 70, 40, 20, 50
_TRAINING, _VALIDATION, _GRID, _TEXT = (31, 119, 180), (214, 39, 40), (225, 225, 225), (40, 40, 40)
#: Of a film: size of one episode's picture, those side by side, pictures a second.
_TILE, _COLUMNS, _FILM_HZ = (180, 240), 3, 10
_GOOD, _BAD = (44, 160, 44), (214, 39, 40)
#: The last picture stays so long [s].
_LAST_S = 1.0
_FRAME_PX = 4


def draw_curve(curve: LossCurve, title: str, path: Path) -> None:
    """Losses over steps, on a logarithmic scale, as PNG. Raises OSError."""
    picture = Image.new("RGB", _SIZE, "white")
    draw = ImageDraw.Draw(picture)
    width, height = _SIZE[0] - _LEFT - _RIGHT, _SIZE[1] - _TOP - _BOTTOM
    values = [max(value, 1e-9) for value in (*curve.training, *curve.validation)] or [1.0]
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    high = max(high, low + 1)
    most = max([1, *curve.steps])

    def place(step, value):
        return (_LEFT + width * step / most,
                _TOP + height * (1.0 - (math.log10(max(value, 1e-9)) - low) / (high - low)))

    for power in range(low, high + 1):
        _, y = place(0, 10.0**power)
        draw.line([(_LEFT, y), (_LEFT + width, y)], fill=_GRID)
        draw.text((8, y - 6), "%g" % 10.0**power, fill=_TEXT)
    for part in range(5):
        x, _ = place(most * part / 4, 1.0)
        draw.line([(x, _TOP), (x, _TOP + height)], fill=_GRID)
        draw.text((x - 12, _TOP + height + 6), "%d" % (most * part / 4), fill=_TEXT)
    for name, losses, colour, row in (("training", curve.training, _TRAINING, 0),
                                      ("episodes that only judge", curve.validation, _VALIDATION, 1)):
        if len(losses) > 1:
            draw.line([place(*point) for point in zip(curve.steps, losses, strict=True)], fill=colour, width=2)
        draw.text((_LEFT + width - 170, _TOP + 8 + 14 * row), name, fill=colour)
    draw.text((_LEFT, 14), title, fill=_TEXT)
    draw.text((_LEFT + width // 2 - 20, _SIZE[1] - 20), "steps of Adam", fill=_TEXT)
    write_whole(path, lambda draft: picture.save(draft, "PNG"))


def choose(score: Score, each: int = 3) -> list[int]:
    """Seeds of up to `each` good and `each` bad episodes."""
    good = [seed for seed, one in score.results.items() if one["success"]][:each]
    return good + [seed for seed, one in score.results.items() if not one["success"]][:each]


def film(core: Core, policy: Acting, seeds: list[int], path: Path) -> None:
    """Play episodes again and film them side by side, three in a row: the frame becomes green or red when they end.
    Raises OSError, DemonstrationError."""
    every = max(round(core.choices.control_freq / _FILM_HZ), 1)
    episodes = [_filmed(core, policy, seed, every) for seed in seeds]
    length = max(len(frames) for frames in episodes) + round(_LAST_S * _FILM_HZ)
    rows = math.ceil(len(episodes) / _COLUMNS)
    height, width = _TILE
    made = Film(path.with_name(path.name + ".part"), _FILM_HZ, (rows * height, min(len(episodes), _COLUMNS) * width))
    try:
        for index in range(length):
            whole = np.zeros((rows * height, min(len(episodes), _COLUMNS) * width, 3), dtype=np.uint8)
            for number, frames in enumerate(episodes):
                row, column = divmod(number, _COLUMNS)
                whole[row * height:(row + 1) * height, column * width:(column + 1) * width] = frames[
                    min(index, len(frames) - 1)]
            made.add(whole)
        made.close()
        made.path.replace(path)
    except BaseException:
        made.drop()
        raise


def _filmed(core, policy, seed, every):
    frames, count = [], 0

    def take(_):
        nonlocal count
        if count % every == 0:
            frames.append(core.look(_TILE[1], _TILE[0]).copy())
        count += 1

    result = play(core, policy, seed, take)
    last = frames[-1].copy()
    colour = _GOOD if result["success"] else _BAD
    for edge in (np.s_[:_FRAME_PX], np.s_[-_FRAME_PX:], np.s_[:, :_FRAME_PX], np.s_[:, -_FRAME_PX:]):
        last[edge] = colour
    return [*frames, last]
