# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a bench: ratios to the peers as bars, distributions as steps. Drawn with OpenCV, which is installed."""
import math

import cv2
import numpy as np

_INK, _PAPER, _GRID = (60, 60, 60), (255, 255, 255), (225, 225, 225)
# Blue, green, red, violet, orange, brown [BGR]: easy to distinguish on dark and on light backgrounds.
_COLOURS = ((176, 114, 31), (60, 150, 60), (50, 50, 200), (150, 80, 130), (20, 130, 240), (70, 90, 120))
_WIDTH, _LEFT, _ROW = 1000, 470, 22


def ratios(rows, path):
    """Draw the ratio of ours to the peer's for each row with a peer, on a logarithmic axis; goals as ticks.

    A row that was zero in some round, such as unsolved poses, is left out: that axis has no zero.
    """
    rows = [row for row in rows if row.ratio and min(row.ratios) > 0.0]
    if not rows:
        return
    low = min(-1, math.floor(min(math.log10(min(row.ratios)) for row in rows)))
    high = max(1, math.ceil(max(math.log10(max(row.ratios)) for row in rows)))
    canvas = np.full((60 + _ROW * len(rows), _WIDTH, 3), _PAPER, dtype=np.uint8)

    def place(value):
        return int(_LEFT + (math.log10(value) - low) / (high - low) * (_WIDTH - _LEFT - 60))

    for power in range(low, high + 1):
        x = place(10.0 ** power)
        cv2.line(canvas, (x, 30), (x, canvas.shape[0] - 20), _INK if power == 0 else _GRID, 1)
        _write(canvas, "%g" % 10.0 ** power, x - 8, 22)
    _write(canvas, "ours to the peer's", 12, 22)
    for k, row in enumerate(rows):
        y = 40 + _ROW * k
        _write(canvas, "%s / %s" % (row.what, row.peer_name), 12, y + 8, 0.36)
        colour = {None: _COLOURS[0], True: _COLOURS[1], False: _COLOURS[2]}[row.met]
        ends = sorted((place(1.0), place(row.ratio)))
        cv2.rectangle(canvas, (ends[0], y), (ends[1], y + 10), colour, -1)
        cv2.line(canvas, (place(min(row.ratios)), y + 5), (place(max(row.ratios)), y + 5), _INK, 1)
        for kind, bound in row.goal.items():
            if kind.startswith("ratio"):
                cv2.line(canvas, (place(bound), y - 2), (place(bound), y + 12), _INK, 2)
        _write(canvas, "%.3g" % row.ratio, ends[1] + 6, y + 9, 0.36)
    _save(path, canvas)


def distribution(title, entry, path):
    """Draw {"unit": ..., "values": {name: numbers}} as the share of values below x, on a logarithmic axis if the values
    span several decades."""
    values = {name: np.sort(some) for name, some in entry["values"].items() if len(some)}
    if not values:
        return
    everything = np.concatenate(list(values.values()))
    logarithmic = everything.min() > 0 and everything.max() / everything.min() > 50
    scale = np.log10 if logarithmic else np.asarray
    low, high = float(scale(everything.min())), float(scale(np.percentile(everything, 99.9)))
    high = high if high > low else low + 1.0
    left, top, width, height = 60, 60, 700, 320
    canvas = np.full((top + height + 50, 960, 3), _PAPER, dtype=np.uint8)
    _write(canvas, "%s: share of values below [%s]" % (title, entry["unit"]), 20, 24, 0.5)
    for k in range(5):
        y = top + height - int(height * k / 4)
        cv2.line(canvas, (left, y), (left + width, y), _GRID, 1)
        _write(canvas, "%d %%" % (25 * k), 12, y + 4)
        at = low + (high - low) * k / 4
        _write(canvas, "%.3g" % (10.0 ** at if logarithmic else at), left + int(width * k / 4) - 10, top + height + 18)
    for k, (name, some) in enumerate(values.items()):
        x = left + (scale(np.maximum(some, 1e-12)) - low) / (high - low) * width
        y = top + height - height * (np.arange(len(some)) + 1) / len(some)
        points = np.column_stack((np.clip(x, left, left + width), y)).astype(np.int32)
        colour = _COLOURS[k % len(_COLOURS)]
        cv2.polylines(canvas, [points], False, colour, 2, cv2.LINE_AA)
        cv2.rectangle(canvas, (left + width + 15, top + 20 * k), (left + width + 27, top + 20 * k + 10), colour, -1)
        _write(canvas, name, left + width + 33, top + 20 * k + 10)
    _save(path, canvas)


def _save(path, canvas):
    if not cv2.imwrite(str(path), canvas):
        raise OSError("the picture '%s' cannot be written" % path)


def _write(canvas, text, x, y, size=0.4):
    cv2.putText(canvas, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size, _INK, 1, cv2.LINE_AA)


def curves(time_s, joints, path):
    """Draw curves over time, one plot per joint, the left arm's joints beside the right's.

    joints: {name: {title of a curve: (n,) values}}; time_s: (n,).
    """
    width, height, margin = 560, 150, 40
    rows = -(-len(joints) // 2)
    canvas = np.full((rows * height + 40, 2 * width, 3), _PAPER, dtype=np.uint8)
    titles = list(next(iter(joints.values())))
    for k, title in enumerate(titles):
        cv2.line(canvas, (12 + 200 * k, 20), (52 + 200 * k, 20), _COLOURS[k], 2, cv2.LINE_AA)
        _write(canvas, title, 60 + 200 * k, 25)
    for number, (name, values) in enumerate(joints.items()):
        left, top = (number // rows) * width, 40 + (number % rows) * height
        everything = np.concatenate(list(values.values()))
        low, high = float(everything.min()), float(everything.max())
        scale = (height - margin) / max(high - low, 1e-9)
        cv2.rectangle(canvas, (left + 4, top), (left + width - 8, top + height - 8), _GRID, 1)
        for k, title in enumerate(titles):
            x = left + 6 + (time_s - time_s[0]) / (time_s[-1] - time_s[0]) * (width - 16)
            y = top + height - 14 - (values[title] - low) * scale
            points = np.stack([x, y], axis=1).round().astype(np.int32)
            cv2.polylines(canvas, [points], False, _COLOURS[k], 1, cv2.LINE_AA)
        said = "%s  %.2f to %.2f rad, %.0f s" % (name, low, high, time_s[-1] - time_s[0])
        _write(canvas, said, left + 10, top + 14, 0.36)
    cv2.imwrite(str(path), canvas)
