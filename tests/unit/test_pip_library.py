# SPDX-License-Identifier: BSD-3-Clause
"""The library of `pip install .`: complete, and without ROS."""
import ast
import os
import re
import subprocess
import sys
from functools import cache

import pytest
from workspace_tree import ROOT, own_files

try:
    import tomllib
except ImportError:  # Python 3.10
    from pip._vendor import tomli as tomllib

pytestmark = pytest.mark.tree

FRONT_DOORS = ("baxter_lab", "gym_baxter", "demonstrations", "robot_learning")
#: The parts of these packages that know ROS stay behind.
LEFT_OUT = {"baxter_sim_hardware.topics", "demonstrations.over_ros", "robot_learning.over_ros"}
#: Modules of the dependencies of pyproject.toml under another name.
RENAMED = {"PyYAML": "yaml", "python-fcl": "fcl", "pycollada": "collada", "pillow": "PIL", "pybullet-arm64": "pybullet"}
#: Modules that are used where they are there; for what, without them.
OPTIONAL = {
    "rospkg": "finds packages in a workspace; installed packages have their own list",
    "gymnasium": "extra `gym`: the environments' registration",
    "pyarrow": "extra `lerobot`: data sets", "av": "extra `lerobot`: films of cameras",
    "onnxruntime": "extra `onnx`: policies in files of ONNX",
    "scipy": "multiplies faster than Debian's NumPy",
    "h5py": "maps of reach as HDF5", "ompl": "planners by their names in ompl_planning.yaml",
    "llvmlite": "part of numba",
}
TWENTY_LINES = re.compile(r"```python file=pick\.py\n(.*?)```", re.DOTALL)


@cache
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def folders():
    """{Python package at the top: its folder} of the library."""
    return {name: ROOT / folder for name, folder in project()["tool"]["setuptools"]["package-dir"].items()
            if "." not in name}


def path_of(module):
    """The file of a module of the library; None for a name in a module."""
    top, _, rest = module.partition(".")
    place = folders()[top].joinpath(*rest.split(".")) if rest else folders()[top]
    return next((path for path in (place / "__init__.py", place.with_suffix(".py")) if path.is_file()), None)


def imports(module, path):
    """Names of modules that a file imports, at its top or later, absolute; a name in a module may be among them."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            base = ".".join(parts[:len(parts) - node.level + 1]) if node.level else ""
            whole = ".".join(filter(None, (base, node.module)))
            found.add(whole)
            found.update("%s.%s" % (whole, alias.name) for alias in node.names)
    return found


def reached():
    """{module of the library that the front doors may import: what it imports}."""
    found, waiting = {}, [name for door in FRONT_DOORS for name in modules_in(door)]
    while waiting:
        module = waiting.pop()
        path = path_of(module) if module.partition(".")[0] in folders() else None
        if path is None or module in found:
            continue
        found[module] = imports(module, path)
        waiting += [*found[module], *(module.rsplit(".", depth)[0] for depth in range(1, module.count(".") + 1))]
    return found


def modules_in(package):
    folder = folders()[package]
    return [".".join((package, *path.relative_to(folder).with_suffix("").parts)).removesuffix(".__init__")
            for path in sorted(folder.rglob("*.py"))
            if ".".join((package, *path.relative_to(folder).parts[:-1])) not in LEFT_OUT]


def declared():
    lines = project()["project"]["dependencies"]
    names = {re.match(r"[A-Za-z0-9-]+", line)[0] for line in lines}
    return {RENAMED.get(name, name).replace("-", "_") for name in names}


def test_the_library_imports_what_it_declares_and_nothing_of_ros():
    known = {*sys.stdlib_module_names, *declared(), *folders(), *OPTIONAL}
    found = {module: foreign for module, names in reached().items()
             if (foreign := {name.partition(".")[0] for name in names} - known)}
    assert found == {}
    assert len(reached()) > 100  # else the search itself is broken


def test_a_reached_import_of_ros_is_found(tmp_path):
    path = tmp_path / "inner.py"
    path.write_text("from . import other\ndef later():\n    from rospy.topics import Publisher\n", encoding="utf-8")
    assert imports("pack.inner", path) == {"pack", "pack.other", "rospy.topics", "rospy.topics.Publisher"}


def test_every_folder_of_the_packages_is_listed():
    listed = {name for name in project()["tool"]["setuptools"]["packages"] if not name.startswith("baxter_lab_share.")}
    there = {name.rpartition(".")[0] if not is_package else name
             for top, folder in folders().items() for path in folder.rglob("*.py")
             for is_package in [path.name == "__init__.py"]
             for name in [".".join((top, *path.relative_to(folder).with_suffix("").parts)).removesuffix(".__init__")]}
    assert there - listed == LEFT_OUT
    assert listed <= there


def test_shared_files_are_where_they_are_listed():
    tables = project()["tool"]["setuptools"]
    for name, patterns in tables["package-data"].items():
        folder = ROOT / tables["package-dir"][name]
        assert all(any(folder.glob(pattern)) for pattern in patterns), name


def test_pins_that_matter_are_those_of_the_workspace():
    from baxter_lab import meshes

    texts = [(ROOT / name).read_text(encoding="utf-8") for name in ("requirements.txt", "requirements-nodeps.txt")]
    assert "%s==%s " % (meshes.PROJECT, meshes.VERSION) in texts[1]
    bullet = [line for line in project()["project"]["dependencies"] if line.startswith("pybullet")]
    assert [re.match(r"\S+==[\d.]+", line)[0] for line in bullet] == re.findall(r"(?m)^pybullet\S*==[\d.]+", texts[0])


@pytest.mark.long
def test_it_installs_without_ros_and_picks_up_a_block(tmp_path):
    source, home = tmp_path / "source", tmp_path / "home"
    home.mkdir()
    wanted = ("src/", "docs/python.md", "pyproject.toml", "LICENSE")
    for name in own_files():  # a copy, since setuptools leaves files in its source
        if name.startswith(wanted):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    base = os.path.realpath("/usr/bin/python3")
    plain = {"HOME": str(home), "PATH": "/usr/bin:/bin",
             **{name: value for name, value in os.environ.items() if name.startswith(("PIP_", "SSL_", "http", "HTTP"))}}
    subprocess.run([base, "-m", "venv", str(tmp_path / "venv")], check=True)
    python = str(tmp_path / "venv" / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", str(source) + "[gym]"], check=True, env=plain)
    program = tmp_path / "pick.py"
    program.write_text(TWENTY_LINES.search((ROOT / "docs/python.md").read_text(encoding="utf-8"))[1], encoding="utf-8")
    for command in ([python, str(program)], [python, str(ROOT / "src/baxter/gym_baxter/test/checked_by_gymnasium.py")]):
        done = subprocess.run(command, env=plain, cwd=home, capture_output=True, text=True, timeout=900, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
