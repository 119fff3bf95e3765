# SPDX-License-Identifier: BSD-3-Clause
"""The faults of faults.yaml, and what each of them makes of its file. No ROS."""

from __future__ import annotations

import ast
import random
from dataclasses import dataclass, fields
from pathlib import Path
from xml.etree import ElementTree

import yaml

ROOT = Path(__file__).resolve().parents[2]
FAULTS = Path(__file__).with_name("faults.yaml")
XML_SUFFIXES = (".launch", ".test", ".xml", ".xacro", ".urdf", ".sdf", ".world")
KINDS_OF_TEST = ("unit", "integration")


class FaultError(Exception):
    """A fault cannot be used; the text names it and says what is wrong."""


@dataclass(frozen=True)
class Fault:
    """One entry of the list; the head of faults.yaml says what each field is."""

    id: str
    file: str
    kind: str
    seen: str
    by: str
    tests: tuple[str, ...]
    old: str
    new: str


def read_faults(path: Path = FAULTS) -> list[Fault]:
    """The faults of a list. Raises FaultError for an entry whose fields are not those of `Fault`, and for one id twice.
    """
    expected = {one.name for one in fields(Fault)}
    found: dict[str, Fault] = {}
    for entry in yaml.safe_load(path.read_text(encoding="utf-8")):
        name = entry.get("id", "an entry without an id")
        if set(entry) != expected:
            raise FaultError(f"{name} has the fields {', '.join(entry)}; expected {', '.join(sorted(expected))}")
        if name in found:
            raise FaultError(f"{name} is there twice")
        if not entry["tests"] or entry["by"] not in KINDS_OF_TEST:
            raise FaultError(f"{name} needs tests, and 'by' must be one of {', '.join(KINDS_OF_TEST)}")
        found[name] = Fault(**{**entry, "tests": tuple(entry["tests"])})
    return list(found.values())


def with_fault(fault: Fault, root: Path = ROOT) -> str:
    """The text of the fault's file below `root` with the fault. Raises FaultError where the file has moved, where the
    old text is not in it exactly once, and where the new text is no program or does the same as the old one.
    """
    path = root / fault.file
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FaultError(f"{fault.id}: {fault.file}: {error.strerror}") from error
    count = text.count(fault.old)
    if count != 1:
        raise FaultError(f"{fault.id}: its old text is in {fault.file} {count} times, expected once")
    changed = text.replace(fault.old, fault.new)
    try:
        does_the_same = _meaning(path, changed) == _meaning(path, text)
    except (SyntaxError, ElementTree.ParseError, yaml.YAMLError) as error:
        raise FaultError(f"{fault.id}: {fault.file} with its new text cannot be read: {error}") from error
    if does_the_same:
        raise FaultError(f"{fault.id}: its new text does the same as its old one")
    return changed


def _meaning(path: Path, text: str) -> object:
    """Something that differs where two texts of this file do; comments do not count. Raises the reader's errors."""
    if path.suffix == ".py" or text.startswith("#!/usr/bin/env python3"):
        compile(text, str(path), "exec")  # finds more than the parser alone
        return ast.dump(ast.parse(text))
    if path.suffix in (".yaml", ".yml"):
        return yaml.safe_load(text)
    if path.suffix in XML_SUFFIXES:
        return ElementTree.tostring(ElementTree.fromstring(text))
    return text


def chosen(faults: list[Fault], only: list[str], sample: int | None, seed: int) -> list[Fault]:
    """Those with the ids `only`, or all; of these `sample` at random, in the order of the list. Raises FaultError."""
    known = {fault.id: fault for fault in faults}
    unknown = [name for name in only if name not in known]
    if unknown:
        raise FaultError(f"there is no fault {', '.join(unknown)}; --list shows them")
    faults = [fault for fault in faults if not only or fault.id in only]
    if sample is None:
        return faults
    picked = set(random.Random(seed).sample([fault.id for fault in faults], min(sample, len(faults))))
    return [fault for fault in faults if fault.id in picked]
