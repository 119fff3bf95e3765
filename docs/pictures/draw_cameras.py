#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draw what the cameras can do, from the topics of a running lab, into docs/pictures.

./baxter.sh sim roslaunch baxter_sim_examples vision.launch      # in a first terminal
./baxter.sh sim docs/pictures/draw_cameras.py                    # in a second one

camera_learning.webp: picture, instances, depth and optical flow of the Kinect while the left arm moves.
camera_sensor.webp: the left hand's camera with an ideal shutter, a slow one, and a short one with a small sensor;
the Kinect's depth with its noise.
"""
import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import rospy
from cv_bridge import CvBridge
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import Image

from baxter_dataflow import wait_for
from baxter_interface import Limb
from baxter_interface.programs import EnabledRobot, ProgramFailed, run

FOLDER = Path(__file__).resolve().parent
TILE, QUALITY = (480, 300), 80
KINECT, HAND = "/kinect", "/cameras/left_hand_camera"
TIMEOUT_S = 30.0
# Of the left arm while it is looked at [rad/s]; to and fro, so that it still moves when pictures come late.
SWING, REVERSES_S = {"left_s0": 0.5}, 2.0
# Flow [pixels] that is shown in full colour; depth [m] that is shown black and white.
FULL_FLOW, DEPTH_M = 15.0, (0.6, 2.0)
# Something moves by more than this [pixels].
MOVING = 2.0


@contextlib.contextmanager
def moving(velocities: dict[str, float]) -> Iterator[None]:
    """The left arm moves so, to and fro, and goes back where it was at the end."""
    limb = Limb("left")
    start = limb.joint_angles()
    began = rospy.get_time()

    def swing(_):
        sign = (-1) ** int((rospy.get_time() - began) / REVERSES_S)
        limb.set_joint_velocities({joint: sign * velocity for joint, velocity in velocities.items()})
    timer = rospy.Timer(rospy.Duration(0.02), swing)
    try:
        yield
    finally:
        timer.shutdown()
        timer.join()
        limb.exit_control_mode()
        limb.move_to_joint_positions(start)


@contextlib.contextmanager
def settings(camera: str, **values: float) -> Iterator[None]:
    """The camera has these settings meanwhile."""
    client = Client(camera, timeout=TIMEOUT_S)
    found = client.get_configuration(TIMEOUT_S)
    if found is None:
        raise ProgramFailed("the settings of %s have not come within %g s" % (camera, TIMEOUT_S))
    before = {name: found[name] for name in values}
    client.update_configuration(values)
    try:
        yield
    finally:
        client.update_configuration(before)
        client.close()


def together(topics: Sequence[str],
             fits: Callable[[list[np.ndarray]], bool] = lambda pictures: True) -> list[np.ndarray]:
    """Pictures of the same moment of all topics, the next ones that fit."""
    came, found = {}, []

    def keep(name):
        def on_message(message):
            same = came.setdefault(message.header.stamp.to_nsec(), {})
            same[name] = CvBridge().imgmsg_to_cv2(message)
            if len(same) == len(topics) and fits([same[topic] for topic in topics]):
                found.append([same[topic] for topic in topics])
        return on_message
    subscribers = [rospy.Subscriber(topic, Image, keep(topic)) for topic in topics]
    try:
        wait_for(lambda: found, TIMEOUT_S, timeout_msg="no pictures of the same moment came on " + ", ".join(topics))
    finally:
        for subscriber in subscribers:
            subscriber.unregister()
    return found[0]


def later(topic: str, number: int) -> np.ndarray:
    """The picture that comes as the `number`-th."""
    pictures = []
    return together([topic], lambda one: pictures.append(one) or len(pictures) >= number)[0]


def by_number(numbers: np.ndarray) -> np.ndarray:
    """A colour for each number of a mask; black for 0."""
    hue = (numbers.astype(np.uint32) * 67 % 180).astype(np.uint8)
    bright = np.where(numbers > 0, 230, 0).astype(np.uint8)
    return cv2.cvtColor(np.dstack([hue, np.full_like(hue, 190), bright]), cv2.COLOR_HSV2RGB)


def by_direction(flow: np.ndarray) -> np.ndarray:
    """Hue by the flow's direction, saturation by its length; grey for nothing."""
    length = np.linalg.norm(flow, axis=2)
    hue = np.nan_to_num(np.degrees(np.arctan2(flow[..., 1], flow[..., 0])) % 360.0 / 2.0)
    full = np.nan_to_num(np.clip(255.0 * length / FULL_FLOW, 0.0, 255.0))
    bright = np.where(np.isfinite(length), 255, 128)
    return cv2.cvtColor(np.dstack([hue, full, bright]).astype(np.uint8), cv2.COLOR_HSV2RGB)


def by_depth(depth: np.ndarray) -> np.ndarray:
    """Near is light, nothing is dark blue."""
    share = np.clip((depth - DEPTH_M[0]) / (DEPTH_M[1] - DEPTH_M[0]), 0.0, 1.0)
    grey = np.nan_to_num(240.0 - 200.0 * share).astype(np.uint8)
    blue = np.array([0, 0, 60], np.uint8)
    return np.where(np.isfinite(depth)[..., None], np.dstack([grey] * 3), blue).astype(np.uint8)


def save(name: str, tiles: Sequence[tuple[str, np.ndarray]]) -> None:
    """Four pictures as two rows with their titles."""
    drawn = []
    for title, picture in tiles:
        height, width = picture.shape[:2]
        part = width * TILE[1] // TILE[0]  # the middle of the picture, in the tile's shape
        top = max(0, (height - part) // 2)
        tile = cv2.resize(np.ascontiguousarray(picture[top:top + part]), TILE, interpolation=cv2.INTER_AREA)
        cv2.rectangle(tile, (0, 0), (TILE[0], 24), (255, 255, 255), -1)
        cv2.putText(tile, title, (6, 17), cv2.FONT_HERSHEY_SIMPLEX, 0.48, (0, 0, 0), 1, cv2.LINE_AA)
        drawn.append(tile)
    whole = np.vstack([np.hstack(drawn[:2]), np.hstack(drawn[2:])])
    path = FOLDER / name
    cv2.imwrite(str(path), cv2.cvtColor(whole, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
    print(path)


def draw_learning() -> None:
    topics = [KINECT + name for name in (
        "/rgb/image_raw", "/instance/image_raw", "/ideal_depth/image_raw", "/flow/image_raw")]
    with settings(KINECT, learning_topics=True), moving(SWING):
        picture, instances, depth, flow = together(
            topics, lambda four: np.nanmax(np.abs(four[3]), initial=0.0) > MOVING)
    save("camera_learning.webp", [
        ("rgb/image_raw", picture), ("instance/image_raw", by_number(instances)),
        ("ideal_depth/image_raw", by_depth(depth)), ("flow/image_raw", by_direction(flow))])


def draw_sensor() -> None:
    topic = HAND + "/image"
    ideal = later(topic, 1)
    with settings(HAND, exposure_time=0.02):
        bright = later(topic, 4)
    with settings(HAND, exposure_time=0.001, auto_exposure=True, full_well=1000.0, read_noise=8.0):
        noisy = later(topic, 12)
    with settings(KINECT, depth_noise=True):
        depth = later(KINECT + "/depth/image_raw", 2)
    save("camera_sensor.webp", [
        ("ideal", ideal[..., :3]), ("exposure_time 0.02", bright[..., :3]),
        ("exposure_time 0.001, auto_exposure, full_well 1000", noisy[..., :3]),
        ("depth_noise", by_depth(depth))])


def draw() -> None:
    with EnabledRobot():
        draw_learning()
        draw_sensor()


if __name__ == "__main__":
    sys.exit(run("draw_cameras", draw))
