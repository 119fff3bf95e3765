# SPDX-License-Identifier: BSD-3-Clause
"""Files of packages for Foxglove clients: meshes, and nothing else."""
import errno
import os

import pytest

from web_bridge.errors import BridgeError
from web_bridge.foxglove.assets import Assets
from web_bridge.foxglove.rules import FoxgloveRules


@pytest.fixture
def folder(tmp_path):
    package = tmp_path / "ws" / "robot"
    (package / "meshes" / "base").mkdir(parents=True)
    (package / "meshes" / "base" / "PEDESTAL.DAE").write_bytes(b"mesh")
    (package / "meshes" / "a b.stl").write_bytes(b"blank")
    (tmp_path / "ws" / "robot2").mkdir()
    (tmp_path / "ws" / "robot2" / "secret.stl").write_bytes(b"other")
    (tmp_path / "secret.stl").write_bytes(b"secret")
    (package / "out.stl").symlink_to(tmp_path / "secret.stl")
    (package / "away").symlink_to(tmp_path)
    (package / "in.stl").symlink_to("meshes/a b.stl")
    (package / "loop.stl").symlink_to("loop.stl")
    os.mkfifo(package / "pipe.stl")
    return package


def assets(folder, **options):
    return Assets({"robot": folder}.get, **options)


@pytest.mark.parametrize(("uri", "data"), [
    ("package://robot/meshes/base/PEDESTAL.DAE", b"mesh"), ("package://robot/meshes/a%20b.stl", b"blank"),
    ("package://robot//meshes/base/PEDESTAL.DAE", b"mesh"), ("package://robot/in.stl", b"blank")])
def test_a_file_of_a_package(folder, uri, data):
    assert assets(folder).read(uri) == data


@pytest.mark.parametrize(("uri", "reason"), [
    ("file:///etc/passwd", "is no package://"), ("/etc/passwd", "is no package://"), ("", "is no package://"),
    ("package://robot", "is no package://"), ("package:///etc/a.stl", "is no package://"),
    ("package://../a.stl", "is no package://"),
    ("package://robot/../robot2/secret.stl", "leaves its package"),
    ("package://robot/meshes/../in.stl", "leaves its package"),
    ("package://robot/%2e%2e/robot2/secret.stl", "leaves its package"),
    ("package://robot/..%2frobot2/secret.stl", "leaves its package"),
    ("package://robot/a%00.stl", "leaves its package"),
    ("package://robot/out.stl", "leaves its package"), ("package://robot/away/secret.stl", "leaves its package"),
    ("package://robot/loop.stl", "cannot be read"), ("package://robot/none.stl", os.strerror(errno.ENOENT)),
    ("package://robot/meshes", os.strerror(errno.EISDIR)), ("package://robot/pipe.stl", "is no file"),
    ("package://nobody/a.stl", "the package nobody is not on this machine"),
    ("package://robot/" + "a" * 5000, os.strerror(errno.ENAMETOOLONG))])
def test_everything_else_is_refused(folder, uri, reason):
    with pytest.raises(BridgeError, match=reason):
        assets(folder).read(uri)


def test_a_link_to_a_package_is_followed(folder, tmp_path):
    (tmp_path / "link").symlink_to(folder)
    assert assets(tmp_path / "link").read("package://robot/meshes/base/PEDESTAL.DAE") == b"mesh"


def test_a_file_that_is_too_large(folder):
    with pytest.raises(BridgeError, match="has 4 bytes; at most 3"):
        assets(folder, largest_file=3).read("package://robot/meshes/base/PEDESTAL.DAE")


@pytest.mark.parametrize("uri", ["package://robot/meshes/base/PEDESTAL.DAE", "package://robot/a%20b.stl"])
def test_by_default_meshes_may_be_read(uri):
    FoxgloveRules().check_asset(uri)


@pytest.mark.parametrize("uri", [
    "package://robot/config/secrets.yaml", "package://robot/scripts/run.py", "package://robot/.git/config",
    "file:///tmp/a.stl", "http://host/a.stl", "package://robot/../a.stl", "package://robot/a.stl\n",
    "package://robot/a.stl.sh"])
def test_by_default_only_files_that_show_a_robot_may_be_read(uri):
    with pytest.raises(BridgeError, match="asset_uri_allowlist"):
        FoxgloveRules().check_asset(uri)
