# SPDX-License-Identifier: BSD-3-Clause
"""Cameras: one picture compared with PyBullet's own rendering of the vendor's meshes, and the picture rate of a lab."""
import re
import select
import socket
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
import pybullet
import rospkg
from labs import Lab
from PIL import Image as PillowImage
from sensor_msgs.msg import Image, PointCloud2

import xacro
from lab_testing.waiting import wait_until
from model_files.resources import ResourceFinder
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from urdf_model import merge_fixed, parse_urdf
from urdf_model.transforms import inverse, pose_matrix
from world_picture.drawing import DrawingCache

SECONDS, PICTURES, NAIVE_PICTURES = 10.0, 40, 4
SIZE = (640, 400)
FIELD_RAD = 1.2
CAMERAS = ("head_camera", "left_hand_camera", "right_hand_camera")
# Camera poses: the whole robot seen from the front left; its hand camera, which looks at the floor.
OUTSIDE = pose_matrix((2.6, 1.2, 1.6), (0.0, 0.25, np.pi + 0.45)) @ OPTICAL
CWRU = ("cwru_baxter_sim", "baxter_world.launch")
BOXES = """<robot name="boxes"><link name="link"><visual><origin xyz="0 0 -0.05"/><geometry><box size="60 60 0.1"/>
</geometry><material name="floor">{0}</material></visual><visual><origin xyz="0 0 0.5"/><geometry><box size="1 1 1"/>
</geometry><material name="block">{0}</material></visual></link></robot>"""


def measure(report, quick, number):
    pictures(report, 4 if quick else PICTURES, 1 if quick else NAIVE_PICTURES)
    textures(report, 4 if quick else PICTURES)
    for pace in ("1.0", "0"):
        streams(report, 2.0 if quick else SECONDS, pace)


def pictures(report, count, naive_count):
    """Both renderers in this process, in turns, with the robot moving between pictures: CPU time of all threads."""
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    xml = xacro.process_file(file).toxml()
    merged = merge_fixed(parse_urdf(xml, source=file))
    joints = [joint.name for joint in merged.joints.values()]
    finder = ResourceFinder()
    mirror = Mirror(DrawingCache(), finder, print)
    mirror.set_scene([{"name": "floor", "urdf": None, "joints": []}, {"name": "robot", "urdf": xml, "joints": joints}])
    renderer, pinhole = GlRenderer(), Pinhole.from_field_of_view(*SIZE, FIELD_RAD, 0.06, 100.0)
    naive = Naive(xml, finder)
    for title, place in (("outside", None), ("left hand", "left_hand_camera")):
        def pose(place=place):
            if place is None:
                return OUTSIDE
            frame = merged.frames[place]
            return mirror.bodies["robot"].link_matrix(frame.link) @ frame.offset

        ours = []
        for step in range(-2, count):
            angle = 0.3 + 0.01 * step
            mirror.set_state(np.concatenate([[0, 0, 0, 0, 0, 0, 1], [0, 0, 0.93, 0, 0, 0, 1],
                                             np.full(len(joints), angle)]))
            begin = time.process_time()
            renderer.render(mirror, pinhole, pose())
            if step >= 0:  # the first pictures load the meshes
                ours.append(1e3 * (time.process_time() - begin))
        theirs = [naive.picture(joints, 0.3 + 0.01 * step, pinhole, pose()) for step in range(naive_count)]
        report.add("CPU of a picture of %d x %d, %s" % (*SIZE, title), statistics.median(ours), "ms",
                   ("vendor meshes, TinyRenderer", statistics.median(theirs)), ratio_most=0.1)
    renderer.close()
    naive.close()


def textures(report, count):
    """A world of two boxes that fill the picture, with a texture and, in turns, in one colour."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "noise.png"
        pixels = np.random.default_rng(1).integers(0, 255, (1024, 1024, 3), dtype=np.uint8)
        PillowImage.fromarray(pixels).save(path)
        cache, drawn = DrawingCache(folder), []
        for material in ('<texture filename="%s" repeats="20 20"/>' % path, '<color rgba="0.5 0.5 0.5 1"/>'):
            mirror = Mirror(cache, lambda name: name, print)
            mirror.set_scene([{"name": "boxes", "urdf": BOXES.format(material), "joints": []}])
            mirror.set_state(np.array([0, 0, 0, 0, 0, 0, 1.0]))
            drawn.append((GlRenderer(), mirror, []))
        pinhole = Pinhole.from_field_of_view(*SIZE, FIELD_RAD, 0.06, 100.0)
        for step in range(-2, count):
            for renderer, mirror, spent in drawn:
                begin = time.process_time()
                renderer.render(mirror, pinhole, OUTSIDE)
                if step >= 0:
                    spent.append(1e3 * (time.process_time() - begin))
        (_, _, ours), (_, _, plain) = drawn
        report.add("CPU of a picture of %d x %d, all textured" % SIZE, statistics.median(ours), "ms",
                   ("in one colour", statistics.median(plain)), ratio_most=1.2)
        for renderer, _, _ in drawn:
            renderer.close()


class Naive:
    """Without our renderer: the physics client draws the description as it is."""

    def __init__(self, xml, finder):
        self._client = pybullet.connect(pybullet.DIRECT)
        # PyBullet reads a line in parts of a thousand characters and adds a line break after each part, also within
        # words.
        lines = xml.replace(">", ">\n")
        with tempfile.NamedTemporaryFile("w", suffix=".urdf", encoding="utf-8") as file:
            file.write(re.sub(r"package://[^\"']+", lambda found: finder(found.group()) or "", lines))
            file.flush()
            self._robot = pybullet.loadURDF(file.name, [0, 0, 0.93], useFixedBase=True, physicsClientId=self._client)
        floor = pybullet.createVisualShape(pybullet.GEOM_BOX, halfExtents=[50, 50, 0.001], physicsClientId=self._client)
        pybullet.createMultiBody(baseVisualShapeIndex=floor, physicsClientId=self._client)
        self._index = {pybullet.getJointInfo(self._robot, k, physicsClientId=self._client)[1].decode(): k
                       for k in range(pybullet.getNumJoints(self._robot, physicsClientId=self._client))}

    def picture(self, joints, angle, pinhole, pose):
        """Draw one picture; return the time that it took [ms]."""
        for name in joints:
            pybullet.resetJointState(self._robot, self._index[name], angle, physicsClientId=self._client)
        turn = np.diag([1.0, -1.0, -1.0, 1.0])
        clip = pinhole.clip_matrix()
        clip[1] *= -1.0
        begin = time.process_time()
        pybullet.getCameraImage(
            pinhole.width, pinhole.height, (turn @ inverse(pose)).T.ravel().tolist(), (clip @ turn).T.ravel().tolist(),
            renderer=pybullet.ER_TINY_RENDERER, physicsClientId=self._client)
        return 1e3 * (time.process_time() - begin)

    def close(self):
        pybullet.disconnect(physicsClientId=self._client)


def streams(report, seconds, pace="1.0"):
    """Case Western's world with both arms moving: the real-time factor without pictures, then with them.

    ``pace``: the requested real-time factor; at 0, as fast as possible, only physics is measured.
    """
    with Lab(CWRU, gui="false", enable="true", real_time_factor=pace) as lab:
        lab.part("swing")
        for camera in CAMERAS:
            settings = "{name: %s, settings: {width: %d, height: %d, fps: 60}}" % (camera, *SIZE)
            lab.start("rosservice", "call", "/cameras/open", settings).wait(30)
        blind = lab.factor(seconds)
        topics = [("/cameras/%s/image" % camera, Image) for camera in CAMERAS]
        for title, watched, goal in (("one camera", topics[1:2], 30.0),
                                     ("three cameras and the Kinect's points",
                                      [*topics, ("/kinect/depth/points", PointCloud2)], 8.0)):
            counts, factor = count_messages(lab, watched, seconds)
            if pace == "0":
                report.add("%s, no pace: real-time factor" % title, factor, "", ("nobody looks", blind))
                continue
            report.add("%s: pictures a second of each" % title, min(counts) / seconds, "Hz", least=goal)
            report.add("%s: real-time factor" % title, factor, "", least=0.95)
            report.add("%s: real-time factor beside" % title, factor, "", ("nobody looks", blind), ratio_least=0.98)


def count_messages(lab, watched, seconds):
    """Return the number of messages on each of [(topic, class)] in ``seconds``, and the real-time factor during that
    time."""
    counters = [Counter(lab.sink(topic, message_class)) for topic, message_class in watched]
    for counter in counters:
        counter.wait(1)
    before, simulated, wall = [counter.messages for counter in counters], lab.now(), time.monotonic()
    while time.monotonic() < wall + seconds:
        for counter in select.select(counters, [], [], max(0.0, wall + seconds - time.monotonic()))[0]:
            counter.drain()
    factor = (lab.now() - simulated) / (time.monotonic() - wall)
    counts = [counter.messages - start for counter, start in zip(counters, before, strict=True)]
    for counter in counters:
        counter.close()
    return counts, factor


class Counter:
    """Counts the messages of a connection; reads only their lengths."""

    _scratch = bytearray(1 << 22)

    def __init__(self, connection):
        self._connection = connection
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        connection.setblocking(False)
        self._length, self._missing = b"", 0
        self.messages = -1  # the first block is the publisher's header

    def fileno(self):
        """The socket's descriptor, for select."""
        return self._connection.fileno()

    def drain(self):
        """Read the bytes that have arrived."""
        while True:
            try:
                if self._missing:
                    taken = self._connection.recv_into(self._scratch, min(self._missing, len(self._scratch)))
                    self._missing -= taken
                    self.messages += self._missing == 0
                else:
                    piece = self._connection.recv(4 - len(self._length))
                    taken, self._length = len(piece), self._length + piece
                    if len(self._length) == 4:
                        self._missing, self._length = int.from_bytes(self._length, "little"), b""
            except BlockingIOError:
                return
            if not taken:
                raise SystemExit("the publisher closed the connection")

    def wait(self, messages, timeout_s=60.0):
        """Read until this many messages have arrived."""
        def have_come():
            self.drain()
            return self.messages >= messages

        wait_until(have_come, "%d pictures" % messages, timeout_s, 0.001)

    def close(self):
        self._connection.close()
