# SPDX-License-Identifier: BSD-3-Clause
"""The pins of Python packages, for each supported Python: one version each; with `--long`, asked of the package index:
wheels exist, they want nothing that is not pinned, and they work with Debian's numpy."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
# Ubuntu 22.04, Debian 12, Debian 13: the C library, and Debian's numpy. Ubuntu's own is too old, pip brings one.
SYSTEMS = {"3.10": (35, None), "3.11": (36, "1.24.2"), "3.13": (41, "2.2.4")}
MACHINES = ("x86_64", "aarch64")
# What pip compiles: these have no wheel for arm64.
COMPILED = {"x86_64": set(), "aarch64": {"pybullet", "moderngl", "glcontext", "ruckig"}}
# What pinned packages want and Debian's packages bring.
DEBIANS = {"defusedxml", "pyparsing", "python-dateutil", "pyyaml", "six"}
LIMIT_S = 600


def pins(file: str, python: str, machine: str) -> list[Requirement]:
    """The lines of a file that hold for a Python on a processor."""
    lines = [line.split("#")[0].strip() for line in (ROOT / file).read_text().splitlines()]
    here = {"python_version": python, "python_full_version": python + ".0", "platform_machine": machine}
    found = [Requirement(line) for line in lines if line]
    return [pin for pin in found if pin.marker is None or pin.marker.evaluate(here)]


def wheels(python: str, machine: str, given: list[str], *options: str) -> set[str]:
    """The names of what pip would install, from wheels alone. Markers within packages are read for our Python."""
    platforms = [f"--platform=manylinux_2_{minor}_{machine}" for minor in range(SYSTEMS[python][0], 4, -1)]
    command = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--quiet", "--report", "-",
               "--only-binary", ":all:", "--implementation=cp", "--python-version", python, "--target", "unused",
               *platforms, f"--platform=manylinux2014_{machine}", *options, *given]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr
    return {canonicalize_name(entry["metadata"]["name"]) for entry in json.loads(done.stdout)["install"]}


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("python", SYSTEMS)
def test_each_package_has_one_version(python, machine):
    both = pins("requirements.txt", python, machine) + pins("requirements-nodeps.txt", python, machine)
    names = [canonicalize_name(pin.name) for pin in both]
    assert len(names) == len(set(names)) and {"numpy", "ruff"} < set(names)
    assert {pin.name for pin in both if not str(pin.specifier).startswith("==")} == {"numpy"}


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("python", SYSTEMS)
def test_one_physics_on_each_python(python, machine):
    found = pins("requirements.txt", python, machine)
    assert sum(pin.name in ("pybullet", "pybullet-arm64") for pin in found) == 1


@pytest.mark.long
@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("python", SYSTEMS)
def test_the_index_has_wheels_and_nothing_is_missing(python, machine):
    numpy = SYSTEMS[python][1]
    wanted = [pin for pin in pins("requirements.txt", python, machine) if pin.name not in COMPILED[machine]]
    given = [pin.name + str(pin.specifier) for pin in wanted] + ([f"numpy=={numpy}"] if numpy else [])
    assert wheels(python, machine, given) - DEBIANS == {canonicalize_name(pin.name) for pin in wanted}
    alone = pins("requirements-nodeps.txt", python, machine)
    found = wheels(python, machine, [pin.name + str(pin.specifier) for pin in alone], "--no-deps")
    assert found == {canonicalize_name(pin.name) for pin in alone}
