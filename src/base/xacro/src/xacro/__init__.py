# SPDX-License-Identifier: BSD-3-Clause
"""PyPI's xacro under its own name, with ``$(find PACKAGE)`` answered by rospack as ROS 1 does.

``import xacro`` gives the installed engine itself, unchanged except for that one look-up: PyPI's release is made for
ROS 2 and would ask ament. Because Python finds this module first, every way into the engine (the ``xacro`` command of
the virtual environment included) resolves packages alike. Raises ImportError where the engine is not installed.
"""
from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
import os
import re
import select
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import rospkg

#: How long a named pipe may be silent [s]; as other files that users name.
PIPE_WAIT_S = 60.0
#: A function of the engine: node, macros, symbols.
_Walk = Callable[[Any, Any, Any], Any]


def _engine_folder() -> Path:
    """Folder of PyPI's xacro. An installed workspace lists ours under that name too, so look at what is inside."""
    for distribution in importlib.metadata.distributions(name="xacro"):
        folder = Path(str(distribution.locate_file("xacro")))
        if (folder / "substitution_args.py").is_file():
            return folder
    raise ImportError("the xacro engine is not installed; run the workspace's set-up, or: %s -m pip install xacro"
                      % sys.executable, name="xacro")


def _load_engine(folder: Path) -> Any:
    spec = importlib.util.spec_from_file_location(
        "xacro", str(folder / "__init__.py"), submodule_search_locations=[str(folder)])
    if spec is None or spec.loader is None:
        raise ImportError("%s is no Python package" % folder, name="xacro")
    engine = importlib.util.module_from_spec(spec)
    sys.modules["xacro"] = engine  # replaces the module that is just being imported
    spec.loader.exec_module(engine)
    return engine


@functools.cache
def _rospack() -> rospkg.RosPack:
    import rospkg  # here, because most files have no $(find) and need not wait for this import
    return rospkg.RosPack()


def _find(package: str) -> str:
    """Path of a ROS package; raises the engine's SubstitutionException, which says where it looked."""
    rospack = _rospack()
    if package not in rospack.list():
        raise _substitution_args.SubstitutionException(
            "no ROS package called '%s' in %s; is the workspace sourced?"
            % (package, ":".join(rospack.get_ros_paths())))
    return rospack.get_path(package)


def _without_inorder(main: Callable[[], Any]) -> Callable[[], Any]:
    """The engine's command without its warning about --inorder, since it knows only this order."""
    @functools.wraps(main)
    def command() -> Any:
        sys.argv[1:] = [word for word in sys.argv[1:] if word not in ("--inorder", "-i")]
        return main()
    return command


def _with_an_end(parse: Callable[..., Any]) -> Callable[..., Any]:
    """The engine's reading of a file, without those that never end: a device, and a named pipe into which nobody writes
    for PIPE_WAIT_S."""
    @functools.wraps(parse)
    def read(inp: Any, filename: str | None = None) -> Any:
        path = os.path.join(_engine.root_dir, filename) if inp is None and filename else ""
        mode = os.stat(path).st_mode if path and os.path.exists(path) else 0
        if stat.S_ISCHR(mode):
            raise _no_file(filename, "a device")
        if not stat.S_ISFIFO(mode):
            return parse(inp, filename)
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as pipe:
            if not select.select([pipe], [], [], PIPE_WAIT_S)[0]:
                raise _no_file(filename, "a named pipe into which nobody has written for %g s" % PIPE_WAIT_S)
            os.set_blocking(pipe.fileno(), True)
            return parse(pipe, filename)
    return read


def _no_file(name: str | None, kind: str) -> Exception:
    _engine.filestack.pop()  # as the engine does: it has not begun to read the file
    return _engine.XacroException("%s is %s; a file is expected" % (name, kind))


# URDF elements that are also names of macros; these are what they are in URDF.
_OF_URDF = {"robot", "link", "joint", "inertial", "visual", "collision", "geometry", "box", "cylinder", "sphere",
            "mesh",
            "origin", "mass", "inertia", "material", "color", "texture", "axis", "limit", "dynamics", "mimic", "parent",
            "child", "safety_controller", "calibration", "gazebo", "transmission", "actuator", "sensor",
            "plugin"}


# xacro's own elements that melodic's files may have without ``xacro:`` -> the attributes that make them xacro's.
_WITHOUT_PREFIX = {"property": ("name",), "macro": ("name",), "include": ("filename",), "arg": ("name", "default"),
                   "if": ("value",), "unless": ("value",), "insert_block": ("name",)}


def _with_melodics_names(eval_all: _Walk, handle_macro_call: _Walk) -> tuple[_Walk, _Walk]:
    """The engine's two functions for files of ROS melodic and before, in which elements and macros of xacro may lack
    the prefix ``xacro:``. They get it, with a warning that names file and lines; noetic ignores them."""
    told: set[str] = set()

    def add_prefix(node: Any) -> None:
        name = node.tagName
        if name not in told:
            told.add(name)
            _engine.warning("<%s> without xacro: is taken for <xacro:%s>, as by ROS melodic; write that (%s)"
                            % (name, name, _places(name)))
        node.tagName = node.nodeName = "xacro:" + name

    def is_of_xacro(node: Any) -> bool:
        wanted = _WITHOUT_PREFIX.get(getattr(node, "tagName", ""))
        return wanted is not None and all(node.hasAttribute(name) for name in wanted)

    @functools.wraps(eval_all)
    def evaluate(node: Any, macros: Any, symbols: Any) -> Any:
        # What a plugin has for elements is its own business.
        if node.tagName != "plugin":
            for child in filter(is_of_xacro, node.childNodes):
                add_prefix(child)
        return eval_all(node, macros, symbols)

    @functools.wraps(handle_macro_call)
    def handle(node: Any, macros: Any, symbols: Any) -> Any:
        if node.tagName in macros and node.tagName not in _OF_URDF:
            add_prefix(node)
        return handle_macro_call(node, macros, symbols)

    return evaluate, handle


def _places(name: str) -> str:
    """Position of an element in the files that are being read, as text."""
    for path in reversed([path for path in _engine.filestack or () if path]):
        try:
            with open(path, encoding="utf-8") as file:
                lines = [str(number) for number, line in enumerate(file, 1) if re.search(r"<%s[\s/>]" % name, line)]
        except (OSError, UnicodeDecodeError):
            continue
        if lines:
            return "%s line %s" % (path, ", ".join(lines))
    return "in a file that is included"


#: Of the engine, which takes the place of this module.
main: Callable[[], Any]
_engine = _load_engine(_engine_folder())
_engine.main = _without_inorder(_engine.main)
_engine.parse = _with_an_end(_engine.parse)
_engine.eval_all, _engine.handle_macro_call = _with_melodics_names(_engine.eval_all, _engine.handle_macro_call)
importlib.import_module("xml.parsers.expat")  # whose errors the engine catches, and which it does not import
_substitution_args: Any = importlib.import_module("xacro.substitution_args")  # the engine's
_substitution_args._eval_find = _find         # $(find PACKAGE)
_substitution_args._eval_dict["find"] = _find  # $(eval find('PACKAGE'))
