# SPDX-License-Identifier: BSD-3-Clause
"""Material scripts of Ogre, Gazebo's renderer: what a plain picture of them needs.

Format: https://ogrecave.github.io/ogre/api/1.12/_material-_scripts.html. Programs, animations and all but the first
technique and its first texture are left out.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

# A text in quotation marks, a brace or the end of a line (which ends an attribute), or a word.
_TOKEN = re.compile(r'"([^"\n]*)"|([{}\n])|([^\s{}"]+)')
# A comment without an end goes on to the end of the text.
_COMMENT = re.compile(r"/\*.*?(?:\*/|\Z)|//[^\n]*", re.DOTALL)
_COLOURS = {"ambient": "ambient", "diffuse": "diffuse", "specular": "specular", "emissive": "emission",
            "self_illumination": "emission"}


@dataclass(frozen=True)
class Material:
    """Colours: red, green, blue from 0 to 1, None where the script has none. ``texture``: a file's name or "";
    ``repeats``: how often it lies side by side, and one below the other; ``cut_out``: whether transparent pixels are
    holes; ``two_sided``: whether it is also seen from behind."""

    ambient: tuple[float, float, float] | None = None
    diffuse: tuple[float, float, float] | None = None
    specular: tuple[float, float, float] | None = None
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture: str = ""
    repeats: tuple[float, float] = (1.0, 1.0)
    cut_out: bool = False
    two_sided: bool = False


def parse_materials(text: str) -> dict[str, Material]:
    """Return {name: Material} of a script. Lines that are not understood are left out."""
    said = {}
    for words, inner in _entries(text):
        if words[:1] == ["material"] and inner is not None:
            # "material A : B" is B, but for what A says.
            name, _, parent = " ".join(words[1:]).partition(":")
            said[name.strip()] = {**said.get(parent.strip(), {}), **_said(inner)}
    return {name: Material(**values) for name, values in said.items()}


def _entries(text: str) -> list[tuple[list[str], list | None]]:
    """The entries of a script: (words, entries of the block behind them, or None for an attribute)."""
    blocks, words = [[]], []
    for quoted, sign, word in _TOKEN.findall(_COMMENT.sub(" ", text) + "\n"):
        if not sign:
            words.append(word or quoted)
            continue
        if sign == "{":
            if not words and blocks[-1] and blocks[-1][-1][1] is None:
                words, _ = blocks[-1].pop()  # they are in the line above
            blocks[-1].append((words, []))
            blocks.append(blocks[-1][-1][1])
        elif words:
            blocks[-1].append((words, None))
        words = []
        if sign == "}" and len(blocks) > 1:
            blocks.pop()
    return blocks[0]


def _said(entries: list) -> dict[str, Any]:
    """Fields of Material that a block sets: those of its first technique. Of several passes, the first counts."""
    said = {}
    for passed in _inside(_inside([entries], "technique")[:1], "pass"):
        for words, _ in passed:
            key, values = words[0], words[1:]
            if key in _COLOURS and len(_numbers(values[:3])) == 3:
                said.setdefault(_COLOURS[key], tuple(min(max(value, 0.0), 1.0) for value in _numbers(values[:3])))
            elif key == "alpha_rejection" and values[:1] != ["always_pass"] or words == ["scene_blend", "alpha_blend"]:
                said["cut_out"] = True
            elif words == ["cull_hardware", "none"]:
                said["two_sided"] = True
        for unit in _inside([passed], "texture_unit"):
            if "texture" not in said:
                said.update(_texture(unit))
    return said


def _texture(unit: list) -> dict[str, Any]:
    said = {}
    for words, _ in unit:
        if words[0] == "texture" and len(words) > 1:
            said["texture"] = words[1]
        elif words[0] == "scale" and len(_numbers(words[1:3])) == 2 and all(_numbers(words[1:3])):
            said["repeats"] = tuple(1.0 / value for value in _numbers(words[1:3]))
    return said if "texture" in said else {}


def _inside(blocks: Iterable[list], key: str) -> list[list]:
    """The blocks named ``key`` in ``blocks``."""
    return [inner for entries in blocks for words, inner in entries if words[:1] == [key] and inner is not None]


def _numbers(words: list[str]) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []
