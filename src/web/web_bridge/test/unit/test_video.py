# SPDX-License-Identifier: BSD-3-Clause
"""Streams and snapshots of a live server in front of a fake graph."""
import http.client
import itertools
import threading
from collections import Counter

import cv2
import numpy as np
import pytest
from fake_graph import FakeGraph, message_class, now
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import String
from tornado import web

from lab_testing.waiting import stretched, wait_until
from web_bridge import pictures, video, video_pages
from web_bridge.access import Access
from web_bridge.cameras import Cameras
from web_bridge.codec import Codec
from web_bridge.loop_thread import LoopThread
from web_bridge.pictures import ImageForm
from web_bridge.serving import Serving
from web_bridge.video import QueryError, VideoOptions, VideoQuery, VideoServer, read_query, routes

IMAGE, PACKED = "/cam/image", "/cam/image/compressed"
TYPES = {IMAGE: Image._type, PACKED: CompressedImage._type, "/plain": Image._type, "/cam/camera_info": "x/Info",
         "/text": String._type}


def image(blue=200, width=24, height=16, encoding="bgr8"):
    data = np.full((height, width, 3), (blue, 0, 0), np.uint8).tobytes()
    message = Image(height=height, width=width, encoding=encoding, step=3 * width, data=data)
    message.header.stamp.secs, message.header.stamp.nsecs = 12, 3456789
    return message


class VideoLab:
    def __init__(self, access=None, **options):
        self.graph = FakeGraph(TYPES)
        self.loop = LoopThread()
        self.cameras = Cameras(self.graph, Codec(message_class, now), self.loop, linger_s=0.05)
        self.video = VideoServer(self.cameras, VideoOptions(access or Access(names=[]), **options))
        self.serving = Serving(self.loop, web.Application(routes(self.video), log_function=lambda handler: None), 0,
                               "127.0.0.1")
        self._connections = []

    def ask(self, address, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.serving.port, timeout=stretched(90))
        self._connections.append(connection)
        connection.request("GET", address, headers={name.replace("_", "-"): text for name, text in headers.items()})
        return connection.getresponse()

    def sentence(self, address, **headers):
        answer = self.ask(address, **headers)
        assert answer.getheader("Content-Type").startswith("text/plain")
        return answer.status, answer.read().decode()

    def stream(self, query="topic=" + IMAGE):
        """A stream that the topic's images reach."""
        before = len(self.video.streams)
        found = Stream(self.ask("/stream?" + query))
        wait_until(lambda: len(self.video.streams) > before, "the stream")
        return found

    def send(self, message, topic=IMAGE, **options):
        wait_until(lambda: topic in self.graph.subscribers, "a subscription to %s" % topic)
        self.graph.send(topic, message, **options)

    def close(self):
        for connection in self._connections:
            connection.close()
        self.loop.run(self.video.close_all())
        self.serving.close()
        self.cameras.shut_down()
        self.loop.stop()


class Stream:
    """Reads as a browser does."""

    def __init__(self, answer):
        assert answer.status == 200, answer.read()
        self.answer = answer
        self.headers = dict(answer.getheaders())
        assert answer.readline() == b"--boundarydonotcross\r\n"

    def part(self):
        """(headers, file) of the next image."""
        headers = http.client.parse_headers(self.answer)
        data = self.answer.read(int(headers["Content-Length"]))
        assert self.answer.readline() == b"\r\n" and self.answer.readline() == b"--boundarydonotcross\r\n"
        return headers, data

    def picture(self):
        return cv2.imdecode(np.frombuffer(self.part()[1], np.uint8), cv2.IMREAD_COLOR)


@pytest.fixture
def lab():
    lab = VideoLab()
    yield lab
    lab.close()


def test_all_clients_share_one_encoding_for_each_size(lab, monkeypatch):
    forms, encode = [], pictures.encode
    monkeypatch.setattr(pictures, "encode", lambda pixels, form: forms.append(form) or encode(pixels, form))
    large = [lab.stream() for _ in range(3)]
    small = [lab.stream("topic=%s&width=12&height=8" % IMAGE) for _ in range(2)]
    for blue in (50, 250):
        lab.send(image(blue))
        for stream, shape in (*((one, (16, 24, 3)) for one in large), *((one, (8, 12, 3)) for one in small)):
            picture = stream.picture()
            assert picture.shape == shape and abs(int(picture[4, 4, 0]) - blue) < 5 and picture[4, 4, 2] < 5
    assert Counter(forms) == {ImageForm(): 2, ImageForm(width=12, height=8): 2}
    assert len(lab.graph.subscribers[IMAGE]) == 1


def test_the_headers_are_those_that_clients_expect(lab):
    stream = lab.stream("topic=cam/image&type=png")
    assert stream.headers["Content-type"] == "multipart/x-mixed-replace;boundary=boundarydonotcross"
    assert stream.headers["Connection"] == "close" and "Transfer-Encoding" not in stream.headers
    assert "no-cache" in stream.headers["Cache-Control"]
    lab.send(image())
    headers, data = stream.part()
    assert headers["Content-type"] == "image/png" and headers["X-Timestamp"] == "12.003456"
    assert data.startswith(b"\x89PNG")


def test_the_subscription_ends_after_the_last_client(lab):
    streams = [lab.stream(), lab.stream()]
    lab.send(image())
    for stream in streams:
        assert lab.graph.subscribers
        stream.picture()
        stream.answer.close()
        lab._connections.pop(0).close()
    wait_until(lambda: not lab.graph.subscribers, "the end of the subscription")
    assert not lab.video.streams
    again = lab.stream()
    lab.send(image(100))
    assert abs(int(again.picture()[0, 0, 0]) - 100) < 5


def test_a_client_that_does_not_read_gets_the_newest_and_holds_up_nobody(lab):
    slow, quick = (lab.stream("type=ros_compressed&topic=" + IMAGE) for _ in range(2))
    filling = bytes(4 << 20)
    for number in range(20):
        lab.send(CompressedImage(format="jpeg", data=b"%2d" % number + filling), PACKED)
        assert int(quick.part()[1][:2]) == number
    seen = []
    while not seen or seen[-1] != 19:
        seen.append(int(slow.part()[1][:2]))
    assert seen == sorted(seen) and len(seen) < 10


def test_streams_of_clients_that_do_not_read_hold_a_limited_amount(lab, monkeypatch, caplog):
    monkeypatch.setattr(video, "MAX_HELD_BYTES", 40 << 20)
    small = lab.stream()
    # 24 MB each, more than the kernel keeps for a connection.
    large = [lab.stream("topic=%s&type=png&quality=0&width=4000&height=%d" % (IMAGE, height))
             for height in (2000, 2001, 2002)]
    lab.send(image())
    wait_until(lambda: len(lab.video.streams) == 2, "the end of two streams")
    assert small.picture().shape == (16, 24, 3)
    lab.send(image(blue=90))
    assert abs(small.picture()[0, 0, 0] - 90.0) < 4.0
    assert len(lab.video.streams) == 2 and caplog.text.count("a stream ends") == 2
    del large  # its sockets close with it


def test_a_late_client_sees_the_last_image_at_once(lab):
    first = lab.stream()
    lab.send(image(90))
    first.picture()
    assert abs(int(lab.stream().picture()[0, 0, 0]) - 90) < 5


def test_the_last_image_is_repeated_at_the_publish_rate():
    lab = VideoLab(repeat_s=0.02)
    try:
        stream = lab.stream()
        lab.send(image(90))
        parts = [stream.part() for _ in range(3)]
        assert len({data for _, data in parts}) == 1
        stamps = [float(headers["X-Timestamp"]) for headers, _ in parts]
        assert stamps[0] == 12.003456 and stamps[1] > 1e9
    finally:
        lab.close()


def test_an_image_that_cannot_be_shown_does_not_end_the_stream(lab, caplog):
    stream = lab.stream()
    for _ in range(2):
        lab.send(image(encoding="hsv8"))
        wait_until(lambda: "'hsv8' is not known" in caplog.text, "the reason")
    lab.send(image(70))
    assert abs(int(stream.picture()[0, 0, 0]) - 70) < 5
    assert caplog.text.count("hsv8") == 1


def test_a_cameras_own_jpeg_is_passed_on_unchanged(lab):
    stream = lab.stream("type=ros_compressed&topic=" + IMAGE)
    lab.send(CompressedImage(format="rgb8; jpeg compressed bgr8", data=b"a file"), PACKED)
    headers, data = stream.part()
    assert (headers["Content-type"], data) == ("image/jpeg", b"a file")
    # A camera without such a topic.
    plain = lab.stream("type=ros_compressed&width=8&topic=/plain")
    lab.send(image(), "/plain")
    assert plain.picture().shape == (16, 8, 3)
    decoded = lab.stream("default_transport=compressed&type=png&topic=" + IMAGE)
    png = cv2.imencode(".png", np.full((2, 3, 3), 9, np.uint8))[1].tobytes()
    lab.send(CompressedImage(format="png", data=png), PACKED)
    assert decoded.picture().tolist() == [[[9] * 3] * 3] * 2


def snapshot_while(lab, query, **options):
    """A snapshot while images come in, each with another blue."""
    done, blues = threading.Event(), itertools.cycle(range(50, 250, 10))

    def publish():
        while not done.wait(0.02):
            lab.graph.send(IMAGE, image(next(blues)), **options)
    thread = threading.Thread(target=publish)
    thread.start()
    try:
        return lab.ask("/snapshot?" + query)
    finally:
        done.set()
        thread.join()


def test_a_snapshot_is_one_image(lab):
    for query, kind, shape in (("", "jpeg", (16, 24, 3)), ("&type=png&width=6&height=4", "png", (4, 6, 3))):
        answer = snapshot_while(lab, "topic=%s%s" % (IMAGE, query))
        data = answer.read()
        assert answer.status == 200 and answer.getheader("Content-Type") == "image/" + kind
        assert answer.getheader("X-Timestamp") == "12.003456" and int(answer.getheader("Content-Length")) == len(data)
        assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape == shape


def test_a_snapshot_shows_no_old_image_unless_it_is_latched():
    lab = VideoLab(snapshot_s=0.3)
    try:
        stream = lab.stream()
        lab.send(image(90))
        stream.picture()
        status, text = lab.sentence("/snapshot?topic=" + IMAGE)
        assert status == 504 and "no image came on /cam/image within 0.3 s" in text
        lab.send(image(90), is_latched=True)
        stream.picture()
        assert lab.ask("/snapshot?topic=" + IMAGE).status == 200
        lab.send(image(encoding="hsv8"), is_latched=True)
        wait_until(lambda: lab.ask("/snapshot?topic=" + IMAGE).status == 400, "the new image")
    finally:
        lab.close()


@pytest.mark.parametrize(("address", "status", "text"), [
    ("/stream", 400, "?topic=/camera/image_raw"), ("/snapshot?topic=", 400, "no topic is given"),
    ("/stream?topic=/nowhere", 404, "nobody publishes /nowhere; there are /cam/image, /cam/image/compressed, /plain"),
    ("/snapshot?topic=/text", 400, "/text has the type std_msgs/String"), ("/stream?topic=a%20b", 400, "no legal name"),
    ("/stream?topic=/cam/image&type=vp8", 501, "needs a video encoder"), ("/stream?type=gif", 404, "gif is not known"),
    ("/stream?topic=/cam/image&width=0", 400, "width=0"), ("/stream?topic=/cam/image&height=1e9", 400, "1 to 4096"),
    ("/stream?topic=/cam/image&quality=good", 400, "quality=good is no number"),
    ("/stream?topic=/cam/image&width=nan", 400, "width=nan"), ("/stream?topic=/cam/image&width=inf", 400, "width=inf"),
    ("/stream?topic=/cam/image&default_transport=theora", 400, "raw and compressed are"),
    ("/stream?topic=/plain&default_transport=compressed", 404, "nobody publishes /plain/compressed")])
def test_a_query_that_cannot_be_served_gets_a_sentence(lab, address, status, text):
    found = lab.sentence(address)
    assert found[0] == status and text in found[1]


def query_of(**given):
    return read_query(given.get)


def test_queries():
    assert query_of(topic="/a") == VideoQuery("/a", ImageForm())
    assert query_of(topic="/a", type="png", quality="50", width="-1", height="", invert="") == VideoQuery(
        "/a", ImageForm("png", 9, is_turned=True))
    assert query_of(topic="/a", quality="-5", width="12.4", bitrate="1", qos_profile="sensor_data") == VideoQuery(
        "/a", ImageForm(quality=0, width=12))
    with pytest.raises(QueryError):
        query_of(topic="/a", type="h264")


def test_pages(lab):
    page = lab.ask("/").read().decode()
    assert page.index("<h2>/cam/</h2>") < page.index('<a href="stream_viewer?topic=/cam/image">image</a>')
    assert '<a href="snapshot?topic=/plain">' in page and "/text" not in page and "compressed" not in page
    viewer = lab.ask("/stream_viewer?topic=/cam/image&width=5&x=%22%3E").read().decode()
    assert '<img src="stream?topic=/cam/image&amp;width=5&amp;x=%22%3E"' in viewer
    assert "<script" not in lab.ask("/stream_viewer?topic=%3Cscript%3E").read().decode()
    assert "token=a%26b" in video_pages.topics({"/a": Image._type}, Image._type, "a&b")
    assert "Nobody publishes images" in video_pages.topics({}, Image._type)


@pytest.mark.parametrize("headers", [
    {"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"},
    {"Referer": "http://evil.example/a", "Sec_Fetch_Dest": "image"}, {"Referer": "http://evil.example/a"}])
def test_foreign_pages_are_refused(lab, headers):
    for address in ("/", "/stream?topic=" + IMAGE, "/snapshot?topic=" + IMAGE, "/stream_viewer?topic=" + IMAGE):
        status, text = lab.sentence(address, **headers)
        assert status == 403 and text
    assert not lab.graph.subscribers


def test_pages_of_this_machine_may_look_and_read(lab):
    answer = lab.ask("/", Origin="http://localhost:8888")
    assert (answer.status, answer.getheader("Access-Control-Allow-Origin")) == (200, "http://localhost:8888")
    for headers in ({"Referer": "http://localhost:8888/lab"}, {"Host": "localhost"},
                    {"Referer": "https://docs.example/", "Sec_Fetch_Dest": "document"}):
        answer = lab.ask("/", **headers)
        assert (answer.status, answer.getheader("Access-Control-Allow-Origin")) == (200, None)


def test_tokens():
    lab = VideoLab(Access({"drive": True, "look": False}, null_origin=True, names=[]))
    try:
        for query in ("", "?token=wrong"):
            status, text = lab.sentence("/" + query)
            assert status == 403 and "token" in text
        assert "token=look" in lab.ask("/?token=look").read().decode()
        assert lab.ask("/?token=drive", Host="lab.example:80", Referer="http://lab.example/").status == 200
        assert lab.ask("/", Authorization="Bearer look", Origin="null").status == 200
        assert lab.ask("/?token=look", Origin="http://evil.example").status == 403
    finally:
        lab.close()


def test_a_graph_that_fails_is_tried_again(lab):
    subscribe, failures = lab.graph.subscribe, iter([True, False])

    def failing_once(*arguments):
        if next(failures):
            raise RuntimeError("no master")
        return subscribe(*arguments)
    lab.graph.subscribe = failing_once
    assert lab.ask("/snapshot?topic=" + IMAGE).status == 500
    assert snapshot_while(lab, "topic=" + IMAGE).status == 200
