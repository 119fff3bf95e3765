# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of submissions that share code. Free of ROS.

Fingerprints are those of rf_checks.similarity: hashes of runs of tokens after names, numbers, texts and formatting are
made equal. Of each WINDOW of consecutive hashes the smallest is kept (winnowing; Schleimer, Wilkerson and Aiken,
SIGMOD 2003), so any common passage of SPAN + WINDOW - 1 tokens is found with a fraction of the hashes. Code that was
handed out, and code that a large part of the class shares, counts for nobody.
"""
from __future__ import annotations

import re
from collections import Counter, defaultdict
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from rf_checks import similarity

WINDOW = 4
#: A pair is reported if one of both shares this part of its own fingerprints with the other.
MIN_SHARE = 0.5
#: A program with fewer own fingerprints is not compared: short programs are alike without being copied.
MIN_OWN = 16
#: A fingerprint in more of the class than this share, and in more than COMMON_MIN submissions, is common knowledge.
COMMON_SHARE, COMMON_MIN = 0.25, 5
_TOKEN = re.compile(r"\w+|[^\w\s]")
_REMARK = re.compile(r"#.*")


@dataclass(frozen=True)
class Pair:
    """Two submissions' entries; of_first, of_second: the share of each one's own code that is in the other (0 to 1);
    count: how many fingerprints both have. is_same: their files are the same, byte for byte."""

    first: str
    second: str
    of_first: float
    of_second: float
    count: int
    is_same: bool = False


def winnow(hashes: tuple[Any, ...], window: int = WINDOW) -> frozenset[Any]:
    """The set of the smallest hash of each `window` consecutive ones. hashes: sequence in the program's order."""
    if len(hashes) < window:
        return frozenset(hashes)
    return frozenset(min(hashes[k:k + window]) for k in range(len(hashes) - window + 1))


def fingerprints(text: str) -> frozenset[Any]:
    """The winnowed hashes of a program. What Python cannot read, such as Python 2, is compared by its plain tokens."""
    found = similarity.spans(text)
    if not found:
        found = similarity.hashes(_TOKEN.findall(_REMARK.sub("", text)))
    return winnow(found)


def pairs(texts: dict[str, list[str]], handed_out: list[str]) -> list[Any]:
    """Pairs that share much, the most alike first.

    texts: {entry: [text of each program]}. handed_out: texts that all students have.
    """
    # All hashes of these, because a window's smallest depends on the code around it.
    known = frozenset().union(*(similarity.fingerprints(text) for text in handed_out))
    prints = {entry: frozenset().union(*map(fingerprints, programs)) - known for entry, programs in texts.items()}
    owners = defaultdict(list)
    for entry, own in prints.items():
        for one in own:
            owners[one].append(entry)
    most = max(COMMON_MIN, COMMON_SHARE * len(texts))
    common = {one for one, entries in owners.items() if len(entries) > most}
    own_counts = {entry: len(own - common) for entry, own in prints.items()}
    shared = Counter()
    for one, entries in owners.items():
        if one not in common:
            shared.update(combinations(sorted(entries), 2))
    found = [Pair(first, second, count / own_counts[first], count / own_counts[second], count,
                  sorted(texts[first]) == sorted(texts[second]))
             for (first, second), count in shared.items() if min(own_counts[first], own_counts[second]) >= MIN_OWN]
    found = [pair for pair in found if max(pair.of_first, pair.of_second) >= MIN_SHARE]
    found += _same(texts, known, {(pair.first, pair.second) for pair in found})
    return sorted(found, key=lambda pair: (-pair.is_same, -max(pair.of_first, pair.of_second), pair.first, pair.second))


def _same(texts: dict[str, list[str]], known: frozenset[bytes], found: set[Any]):
    """Pairs whose files are the same, where the fingerprints did not tell: many equal ones, or short ones.

    A program without own code, such as a skeleton, is nobody's.
    """
    groups = defaultdict(list)
    for entry, programs in texts.items():
        if any(similarity.fingerprints(text) - known for text in programs) or any(
                not similarity.spans(text) and len(fingerprints(text)) for text in programs):
            groups[tuple(sorted(programs))].append(entry)
    for programs, entries in groups.items():
        count = len(frozenset().union(*map(fingerprints, programs)) - known)
        for first, second in combinations(sorted(entries), 2):
            if (first, second) not in found:
                yield Pair(first, second, 1.0, 1.0, count, True)
