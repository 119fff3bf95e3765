# SPDX-License-Identifier: BSD-3-Clause
"""One lab for many .test files: those that start the same, and that are marked as leaving it as it was.

rostest starts the launch file again for each `<test>`. Marked files become one launch file with one test, the node
shared_lab of lab_testing, which runs their programs one after the other and puts the lab back between them.
"""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

from lab_tests.discovery import mostly_waits, runs_in_real_time, shares_its_lab

DEFAULT_LIMIT_S = 60.0
# For the start of the lab, and to put it back after each file.
START_S, PUT_BACK_S = 60.0, 60.0
# A test's own parts that the launch file can hold for it.
_PARAMETERS = ("param", "rosparam")


def lab_of(path: Path) -> str | None:
    """The launch file without its tests, as text that is the same for the same lab; None where no lab is shared."""
    if not shares_its_lab(path):
        return None
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError:
        return None  # rostest says what is wrong
    for test in root.findall("test"):
        root.remove(test)
    text = ElementTree.canonicalize(ElementTree.tostring(root, encoding="unicode"), strip_text=True)
    return f"{mostly_waits(path)} {runs_in_real_time(path)} {text}"


def write(paths: list[Path], folder: Path) -> tuple[Path, list[Path]]:
    """Write the launch file and plan of files with the same lab to a folder; (launch file, each file's results folder).

    Raises ValueError for a test with parts that only a file of its own can have.
    """
    launch = ElementTree.parse(paths[0]).getroot()
    for test in launch.findall("test"):
        launch.remove(test)
    plan, limit_s = [], START_S
    # Two packages may have files of one name.
    results = [folder / f"{number}_{path.stem}" for number, path in enumerate(paths)]
    for path, result in zip(paths, results, strict=True):
        tests = ElementTree.parse(path).getroot().findall("test")
        limit_s += PUT_BACK_S + sum(_limit_s(test) for test in tests)
        plan.append({"file": path.name, "results": str(result), "tests": [_planned(path, test) for test in tests]})
        for test in tests:
            if len(test):
                ElementTree.SubElement(launch, "group", ns=test.attrib["test-name"]).extend(list(test))
    plan_path, launch_path = folder / "plan.json", folder / "shared_lab.test"
    plan_path.write_text(json.dumps(plan, indent=1), encoding="utf-8")
    ElementTree.SubElement(launch, "test", {
        "test-name": "shared_lab", "pkg": "lab_testing", "type": "shared_lab", "args": str(plan_path),
        "time-limit": str(limit_s)})
    ElementTree.ElementTree(launch).write(launch_path, encoding="utf-8", xml_declaration=True)
    return launch_path, results


def _limit_s(test: ElementTree.Element) -> float:
    return float(test.get("time-limit", DEFAULT_LIMIT_S))


def _planned(path: Path, test: ElementTree.Element) -> dict:
    others = sorted({part.tag for part in test if isinstance(part.tag, str)} - set(_PARAMETERS))
    if missing := [name for name in ("test-name", "pkg", "type") if not test.get(name)]:
        raise ValueError(f"{path}: a <test> without {' or '.join(missing)}")
    if others or test.get("ns") or test.get("retry"):
        found = ", ".join(others) or "ns or retry"
        raise ValueError(f"{path.name}: the test of a shared lab may have parameters; found: {found}")
    return {"name": test.attrib["test-name"], "package": test.attrib["pkg"], "type": test.attrib["type"],
            "arguments": test.get("args", "").split(), "time_limit_s": _limit_s(test)}
