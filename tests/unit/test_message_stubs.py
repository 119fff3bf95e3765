# SPDX-License-Identifier: BSD-3-Clause
"""Stubs of messages: what fields read as, what they take, and services."""

import ast

import pytest

import message_stubs

MESSAGE = '''
import genpy
import geometry_msgs.msg

class Thing(genpy.Message):
  _md5sum = "0"
  _type = "lab_msgs/Thing"
  _has_header = False
  LARGE = 3
  __slots__ = ['poses', 'mass']
  _slot_types = ['geometry_msgs/Pose[]', 'float64']
'''
SERVICE = '''
class Ask(object):
  _type = 'lab_msgs/Ask'
  _request_class = AskRequest
'''


@pytest.mark.parametrize(("definition", "read", "taken"), [
    ("float32", "float", "SupportsFloat"), ("float64[9]", "list[float]", "Iterable[SupportsFloat]"),
    ("uint8[]", "bytes", "bytes | bytearray | memoryview | Iterable[int]"), ("uint8", "int", "SupportsIndex"),
    ("time", "genpy.Time", "genpy.Time"), ("string[]", "list[str]", "Iterable[str]"),
    ("geometry_msgs/Pose", "geometry_msgs.msg.Pose", "geometry_msgs.msg.Pose")])
def test_a_field_has_the_type_of_its_definition(definition, read, taken):
    assert message_stubs.types_of(definition) == (read, taken)


def test_a_package_has_a_stub_of_its_messages_and_one_of_its_services(tmp_path):
    for kind, text in (("msg", MESSAGE), ("srv", SERVICE)):
        (tmp_path / "first/lab_msgs" / kind).mkdir(parents=True)
        (tmp_path / "first/lab_msgs" / kind / "_Thing.py").write_text(text)
    (tmp_path / "second/lab_msgs/msg").mkdir(parents=True)
    (tmp_path / "second/lab_msgs/msg/_Thing.py").write_text(MESSAGE.replace("class Thing", "class Other"))
    message_stubs.write_stubs([str(tmp_path / "first"), str(tmp_path / "second")], tmp_path)
    found = (tmp_path / "lab_msgs/msg/__init__.pyi").read_text()
    assert ast.parse(found) and "import geometry_msgs.msg\n" in found and "class Other" not in found
    assert "    LARGE: ClassVar[int]\n" in found and "def poses(self) -> list[geometry_msgs.msg.Pose]: ..." in found
    assert "(self, *args: Any, poses: Iterable[geometry_msgs.msg.Pose] = ..., mass: SupportsFloat = ...)" in found
    assert "    _request_class: type[AskRequest]\n" in (tmp_path / "lab_msgs/srv/__init__.pyi").read_text()
