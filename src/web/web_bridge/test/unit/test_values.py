# SPDX-License-Identifier: BSD-3-Clause
import json
import math
import struct

import cbor2
import genpy
import pytest
from fake_graph import message_class, now
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan, PointCloud2
from std_msgs.msg import Bool, Byte, ByteMultiArray, Float64, Header, Int8, Int64, String, Time, UInt8MultiArray, UInt64
from std_srvs.srv import SetBoolRequest

from web_bridge.errors import BridgeError, FieldError
from web_bridge.values import CborForm, JsonForm, Reader, Writer, from_tag, parts_of

TO_JSON, TO_CBOR = Writer(message_class, JsonForm()), Writer(message_class, CborForm())
READER = Reader(message_class, now)


def read(message, values):
    return READER.fill(message, values)


def as_json(message):
    return json.loads(json.dumps(TO_JSON.values(message), allow_nan=False))


def test_types_have_a_base_and_a_length():
    assert [parts_of(text) for text in ("float64", "geometry_msgs/Pose[]", "float64[36]")] == [
        ("float64", None), ("geometry_msgs/Pose", 0), ("float64", 36)]


def test_bytes_are_base64_and_nan_is_null_in_json():
    scan = LaserScan(ranges=[1.0, math.nan, math.inf], range_max=-math.inf)
    values = as_json(scan)
    assert values["ranges"] == [1.0, None, None] and values["range_max"] is None
    assert as_json(Image(data=b"\0\xff"))["data"] == "AP8="
    assert as_json(Float64(math.nan)) == {"data": None}


def test_large_finite_numbers_stay():
    assert as_json(LaserScan(ranges=[1.7e308, 1.7e308]))["ranges"] == [1.7e308, 1.7e308]


def test_times_are_objects_and_long_integers_numbers():
    assert as_json(Time(now())) == {"data": {"secs": 12, "nsecs": 34}}
    assert as_json(Int64(2 ** 53 + 1)) == {"data": 2 ** 53 + 1}


def test_cbor_has_bytes_and_typed_arrays():
    values = TO_CBOR.values(JointState(name=["a"], position=[1.5, math.nan]))
    assert values["position"].tag == 86
    assert values["position"].value[:8] == struct.pack("<d", 1.5) and values["name"] == ["a"]
    assert TO_CBOR.values(Image(data=b"\0\1"))["data"] == b"\0\1"
    assert TO_CBOR.values(ByteMultiArray(data=[-1, 2]))["data"].tag == 72
    # Arrays of fixed length are lists.
    assert TO_CBOR.values(CameraInfo())["K"] == [0.0] * 9


@pytest.mark.parametrize("message", [
    JointState(header=Header(3, now(), "base"), name=["a", "é"], position=[1.0, -2.5]), Int64(-2 ** 63),
    UInt64(2 ** 64 - 1), CameraInfo(K=[float(i) for i in range(9)]), Image(data=bytes(range(256))), String("\u4f60"),
    Bool(True), Byte(-3),
    PointCloud2(data=b"\0" * 7, is_dense=True), UInt8MultiArray(data=b"abc")], ids=lambda message: message._type)
def test_messages_survive_both_ways(message):
    assert read(type(message)(), as_json(message)) == message
    through_cbor = cbor2.loads(cbor2.dumps(TO_CBOR.values(message)), tag_hook=lambda tag, _immutable: from_tag(tag))
    assert read(type(message)(), through_cbor) == message


def test_what_is_not_given_keeps_its_default_and_headers_are_stamped():
    assert read(JointState(), {"name": ["a"]}).header.stamp.secs == 0
    assert read(JointState(), {"header": {"frame_id": "b"}}).header.stamp == now()
    assert read(JointState(), {"header": {"stamp": {"secs": 1, "nsecs": 2}}}).header.stamp.nsecs == 2
    assert read(Time(), {"data": "now"}).data == now()


def test_arguments_may_be_a_list_or_nothing():
    assert read(SetBoolRequest(), [True]).data is True
    assert read(SetBoolRequest(), None).data is False
    with pytest.raises(FieldError, match="2 values for std_srvs/SetBoolRequest, which has 1 field"):
        read(SetBoolRequest(), [True, False])


def test_what_is_passed_over_is_said_and_the_rest_is_read():
    unread = []
    assert READER.fill(SetBoolRequest(), [True, 5], unread).data is True
    found = READER.fill(JointState(), {"header": {"stamp": {"sec": 5, "nsecs": 6}}, "name": ["a"]}, unread)
    assert (found.header.stamp.secs, found.header.stamp.nsecs, found.name) == (now().secs, 6, ["a"])
    assert READER.fill(Time(), {"data": None}, unread).data == genpy.Time()
    assert [text.partition(" ")[0] for text in unread] == ["2", "header.stamp", "data"]
    with pytest.raises(FieldError, match="data.secs is 'x'"):
        READER.fill(Time(), {"data": {"secs": "x"}}, unread)


def test_arrays_of_times_are_read():
    class Times(genpy.Message):
        _type, __slots__, _slot_types = "test_msgs/Times", ["times", "durations"], ["time[]", "duration[2]"]

    found = Times()
    found.times, found.durations = [], []
    read(found, {"times": ["now", {"secs": 3}], "durations": [{"secs": -1}, {"nsecs": 5}]})
    assert found.times == [now(), genpy.Time(3, 0)]
    assert found.durations == [genpy.Duration(-1, 0), genpy.Duration(0, 5)]


def test_a_header_alone_is_stamped_as_one_inside_of_a_message():
    assert read(Header(), {"frame_id": "base"}).stamp == now()


@pytest.mark.parametrize(("message", "values", "text"), [
    (Float64(), {"date": 1}, "std_msgs/Float64 has no field 'date'; it has data"),
    (Float64(), {"data": None}, "data is None; a number is expected (float64)"),
    (Float64(), {"data": True}, "data is True"),
    (Float64(), {"data": 10 ** 400}, "too large"),
    (Float64(), 3, "the message is 3; an object with the fields of std_msgs/Float64"),
    (Int64(), {"data": 1.0}, "data is 1.0; an integer is expected"),
    (Int64(), {"data": True}, "an integer is expected"),
    (Int64(), {"data": 2 ** 63}, "int64 goes from"),
    (Int8(), {"data": 128}, "int8 goes from -128 to 127"),
    (Bool(), {"data": 1}, "true or false is expected"),
    (String(), {"data": 5}, "a text is expected"),
    (Time(), {"data": "later"}, '"now" is expected'),
    (Time(), {"data": {"secs": -1}}, "data.secs is -1"),
    (Time(), {"data": {"sec": 1}}, "data is {'sec': 1}"),
    (JointState(), {"position": "abc"}, "position is 'abc'; a list is expected (float64[])"),
    (JointState(), {"position": [1.0, "b"]}, "position[1] is 'b'"),
    (JointState(), {"header": {"stamp": {"secs": "x"}}}, "header.stamp.secs is 'x'"),
    (PointCloud2(), {"fields": [{"name": 3}]}, "fields[0].name is 3"),
    (CameraInfo(), {"K": [1.0]}, "K has 1 element; 9 are expected"),
    (Image(), {"data": "a"}, "data is no base64 text"),
    (Image(), {"data": [300]}, "data[0] is 300; uint8 goes from 0 to 255"),
    (Image(), {"data": 3}, "base64 text or a list of numbers"),
])
def test_what_does_not_fit_is_refused_with_its_place(message, values, text):
    with pytest.raises(FieldError) as caught:
        read(message, values)
    assert text in str(caught.value)


def test_tags_of_other_kinds_are_refused():
    with pytest.raises(BridgeError, match="tag 4 is not read"):
        from_tag(cbor2.CBORTag(4, b""))
    with pytest.raises(BridgeError, match="3 bytes cannot hold numbers of 8"):
        from_tag(cbor2.CBORTag(86, b"abc"))
