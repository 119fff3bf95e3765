# SPDX-License-Identifier: BSD-3-Clause
"""The robot expanded from xacro, parsed once for each choice of arguments."""
import functools
import importlib.metadata

import pytest
import rospkg

import xacro
from urdf_model import parse_urdf

VENDOR_URDF = "cmeel.prefix/share/example-robot-data/robots/baxter_description/urdf/baxter.urdf"


@functools.cache
def _expand(arguments):
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    return parse_urdf(xacro.process_file(file, mappings=dict(arguments)).toxml(), source=file)


@pytest.fixture(scope="session")
def expand():
    """Return a function: xacro arguments as keywords -> urdf_model.Robot."""
    return lambda **arguments: _expand(tuple(sorted(arguments.items())))


@pytest.fixture(scope="session")
def vendor():
    """The vendor's own model, from the package that holds the meshes: a reference that is independent of ours."""
    try:
        file = importlib.metadata.distribution("example-robot-data").locate_file(VENDOR_URDF)
    except importlib.metadata.PackageNotFoundError:
        pytest.fail("example-robot-data is not installed: run ./baxter.sh setup")
    return parse_urdf(file.read_text(), source=str(file))
