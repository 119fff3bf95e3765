# SPDX-License-Identifier: BSD-3-Clause
"""PyPI's xacro under its own name, with ``$(find PACKAGE)`` answered by rospack as ROS 1 does.

``import xacro`` gives the installed engine itself, untouched but for that one look-up: PyPI's release is made for ROS 2
and would ask ament. Because Python finds this module first, every way into the engine (the ``xacro`` command of the
virtual environment included) resolves packages alike. Raises ImportError where the engine is not installed.
"""
import functools
import importlib
import importlib.metadata
import importlib.util
import sys


def _engine_folder():
    """Folder of PyPI's xacro. An installed workspace lists ours under that name too, so look at what is inside."""
    for distribution in importlib.metadata.distributions(name="xacro"):
        folder = distribution.locate_file("xacro")
        if (folder / "substitution_args.py").is_file():
            return folder
    raise ImportError("the xacro engine is not installed; run the workspace's set-up, or: %s -m pip install xacro"
                      % sys.executable, name="xacro")


def _load_engine(folder):
    spec = importlib.util.spec_from_file_location(
        "xacro", str(folder / "__init__.py"), submodule_search_locations=[str(folder)])
    engine = importlib.util.module_from_spec(spec)
    sys.modules["xacro"] = engine  # takes the place of the module that is being imported right now
    spec.loader.exec_module(engine)
    return engine


@functools.cache
def _rospack():
    import rospkg  # here, because most files have no $(find) and need not wait for this import
    return rospkg.RosPack()


def _find(package):
    """Path of a ROS package; raises the engine's SubstitutionException, which says where it looked."""
    rospack = _rospack()
    if package not in rospack.list():
        raise _substitution_args.SubstitutionException(
            "no ROS package called '%s' in %s; is the workspace sourced?"
            % (package, ":".join(rospack.get_ros_paths())))
    return rospack.get_path(package)


def _without_inorder(main):
    """The engine's command, which knows one order only, without its remark on everybody who asks for it by name."""
    @functools.wraps(main)
    def command():
        sys.argv[1:] = [word for word in sys.argv[1:] if word not in ("--inorder", "-i")]
        return main()
    return command


_engine = _load_engine(_engine_folder())
_engine.main = _without_inorder(_engine.main)
_substitution_args = importlib.import_module("xacro.substitution_args")  # the engine's
_substitution_args._eval_find = _find         # $(find PACKAGE)
_substitution_args._eval_dict["find"] = _find  # $(eval find('PACKAGE'))
