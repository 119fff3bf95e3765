# SPDX-License-Identifier: BSD-3-Clause
"""The text of a description's file."""
import os

import pytest

from urdf_model import UrdfError, description_text, parse_urdf

XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="${%s}"/></robot>"""


def test_urdf_is_read_as_it_is(tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text("<robot name='\u00e4'/>", encoding="utf-8")
    assert description_text(path) == "<robot name='\u00e4'/>"


def test_xacro_is_expanded(tmp_path):
    path = tmp_path / "r.urdf.xacro"
    path.write_text(XACRO % "'arm_%d' % (3 + 4)")
    assert list(parse_urdf(description_text(path)).links) == ["arm_7"]


@pytest.mark.parametrize("expression", ["1/0", "nothing", "1 +"])
def test_xacro_that_cannot_be_expanded_is_named(tmp_path, expression):
    path = tmp_path / "r.xacro"
    path.write_text(XACRO % expression)
    with pytest.raises(UrdfError, match="xacro cannot expand .*r.xacro: ."):
        description_text(path)


def test_a_file_that_is_missing_or_no_text_is_named(tmp_path):
    with pytest.raises(OSError, match="none.urdf"):
        description_text(tmp_path / "none.urdf")
    (tmp_path / "r.urdf").write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="utf-8"):
        description_text(tmp_path / "r.urdf")


def test_a_device_and_a_pipe_are_not_waited_for(tmp_path):
    (tmp_path / "r.urdf").symlink_to("/dev/zero")
    with pytest.raises(OSError, match="a device"):
        description_text(tmp_path / "r.urdf")
    os.mkfifo(tmp_path / "r.xacro")
    with pytest.raises(OSError, match="a named pipe"):
        description_text(tmp_path / "r.xacro")
