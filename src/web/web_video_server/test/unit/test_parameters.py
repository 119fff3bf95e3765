# SPDX-License-Identifier: BSD-3-Clause
import pytest

from web_bridge.errors import RequestForbidden
from web_bridge.parameters import ParameterError
from web_video_server.parameters import read_parameters


def read(**given):
    return read_parameters(lambda name, default: given.get(name, default))


def test_without_parameters_only_this_machine_is_served():
    found = read()
    assert found.endpoint[:2] == (8080, "localhost") and found.warnings == ()
    assert (found.threads, found.is_verbose) == (2, True)
    assert (found.video.default_type, found.video.repeat_s) == ("mjpeg", 0.0)


def test_published_parameters_are_understood():
    found = read(port=0, address="0.0.0.0", server_threads=4, ros_threads=3, publish_rate=4.0, verbose=False,
                 default_stream_type="png", token="t")
    assert found.endpoint[:2] == (0, "0.0.0.0") and found.warnings == ()
    assert (found.threads, found.is_verbose) == (3, False)
    assert (found.video.default_type, found.video.repeat_s) == ("png", 0.25)
    with pytest.raises(RequestForbidden):
        found.video.access.may_act("")
    assert read(publish_rate=-1).video.repeat_s == read(publish_rate=-1.0).video.repeat_s == 0.0
    assert "everybody on them can see" in read(address="0.0.0.0").warnings[0]


@pytest.mark.parametrize(("given", "text"), [
    ({"port": 70000}, "~port is 70000"), ({"ros_threads": 0}, "~ros_threads is 0"), ({"ros_threads": "x"}, "'x'"),
    ({"server_threads": "two"}, "~server_threads is 'two'"), ({"publish_rate": "x"}, "~publish_rate is 'x'"),
    ({"publish_rate": True}, "~publish_rate is True"), ({"verbose": "yes"}, "~verbose is 'yes'"),
    ({"default_stream_type": "vp8"}, "~default_stream_type: type=vp8 needs a video encoder"),
    ({"default_stream_type": "gif"}, "type=gif is not known")])
def test_a_value_that_cannot_be_served_is_named(given, text):
    with pytest.raises(ParameterError) as caught:
        read(**given)
    assert text in str(caught.value)
