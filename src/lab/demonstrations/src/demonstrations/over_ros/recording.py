# SPDX-License-Identifier: BSD-3-Clause
"""Record what a robot of a ROS master does, or what a file of rosbag has, as a LeRobot data set."""
from __future__ import annotations

import argparse
import contextlib
import queue
import sys
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import Any

import rosbag
import rospy
from std_msgs.msg import String

from command_line.options import Parser, number

from ..frames import MARKS, MAX_RATE_HZ, DemonstrationError
from ..watching import RECORDING, WatchingRecorder, schema_of
from ..writing import SetWriter
from .messages import CAMERAS, MARKS_TOPIC, Heard, topics

#: Wall time for the first picture of every camera, after which it is said that it is waited for, and between two looks
#: [s]; messages that wait at most. A busy machine takes half a minute.
_FOUND_WITHIN_S, _SAID_AFTER_S, _POLL_S, _QUEUE = 90.0, 5.0, 0.1, 4000

#: Messages as they come: (topic, message), or None while none comes.
Feed = Generator[tuple[str, Any] | None, None, None]


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The command line's options."""
    parser = Parser(
        prog="rosrun demonstrations record", description=__doc__,
        epilog="Every success, failure or again on %s ends an episode, and the next begins. States and actions are the "
               "joints' angles and set-points. Publishes ~state (std_msgs/String). Exit status: 0 done, 1 something is "
               "missing or broken, 2 wrong options." % MARKS_TOPIC)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the set, which is made or continued")
    parser.add_argument("--task", required=True, metavar="TEXT", help="what is shown, in words")
    parser.add_argument("--rate", type=number(int, 1, MAX_RATE_HZ), default=20, metavar="HZ",
                        help="frames a second (default: %(default)s)")
    parser.add_argument("--cameras", nargs="+", default=[], choices=tuple(CAMERAS), metavar="CAMERA",
                        help="with pictures: %s" % ", ".join(CAMERAS))
    parser.add_argument("--models", nargs="+", default=[], metavar="MODEL",
                        help="with the poses of these models of /gazebo/model_states")
    parser.add_argument("--bag", type=Path, metavar="FILE", help="out of this file, in place of a robot")
    parser.add_argument("--end", choices=MARKS, default="again", metavar="MARK",
                        help="what the end of --bag means for the last episode: one of %s (default: %%(default)s, it "
                             "is thrown away)" % ", ".join(MARKS))
    return parser.parse_args(argv)


def of_bag(path: Path, heard: Mapping[str, Heard]) -> Feed:
    """The messages of a file in the order of their recording. Raises DemonstrationError."""
    try:
        with rosbag.Bag(str(path)) as bag:
            for entry in bag.read_messages(topics=list(heard)):
                topic, message = entry.topic, entry.message
                if message._type != heard[topic].kind._type:
                    raise ValueError("%s has %s, expected %s" % (topic, message._type, heard[topic].kind._type))
                yield topic, message
    except Exception as error:  # rosbag has many for a broken file
        raise DemonstrationError("%s cannot be read: %s" % (path, error)) from error


def of_robot(heard: Mapping[str, Heard]) -> Feed:
    """The messages of the master's topics, until the node is shut down."""
    waiting: queue.Queue[tuple[str, Any]] = queue.Queue(_QUEUE)
    kept = [rospy.Subscriber(topic, kind.kind, lambda message, name=topic: waiting.put((name, message)),
                             queue_size=100, tcp_nodelay=True) for topic, kind in heard.items()]
    try:
        while kept and not rospy.is_shutdown():
            try:
                yield waiting.get(timeout=_POLL_S)
            except queue.Empty:
                yield None
    finally:
        # A queue that nobody reads fills up, and then holds up all who hear the same topics.
        for one in kept:
            one.unregister()


def sizes(feed: Feed, heard: Mapping[str, Heard], cameras: Sequence[str],
          say: Callable[[str], None] = print) -> dict[str, tuple[int, int]]:
    """{camera: (height, width)} of the first pictures of a feed; what comes before them is passed over. say: hears what
    is waited for. Raises DemonstrationError where one is missing."""
    found: dict[str, tuple[int, int]] = {}
    begin, is_said = time.monotonic(), False
    while set(found) < set(cameras):
        item, waited_s = next(feed, ("", None)), time.monotonic() - begin
        missing = ", ".join(CAMERAS[name] for name in cameras if name not in found)
        if item == ("", None) or waited_s > _FOUND_WITHIN_S:
            raise DemonstrationError("no picture came on %s in %.0f s; is the camera open, and the machine not too "
                                     "busy?" % (missing, waited_s))
        if waited_s > _SAID_AFTER_S and not is_said:
            is_said = True
            say("waiting for a picture on %s" % missing)
        for key, value, _ in heard[item[0]].says(item[1]) if item else ():
            if key in cameras:
                # Films have even sides.
                found[key] = value.shape[0] // 2 * 2, value.shape[1] // 2 * 2
    return found


def record(feed: Feed, heard: Mapping[str, Heard], recorder: WatchingRecorder,
           size: Mapping[str, tuple[int, int]]) -> None:
    """Pass a feed to a recorder until it ends. Raises DemonstrationError, OSError."""
    for item in feed:
        for key, value, stamp in heard[item[0]].says(item[1]) if item else ():
            if key == MARKS_TOPIC:
                recorder.mark(value)
            elif key in size:
                recorder.take(key, value[:size[key][0], :size[key][1]])
            else:
                recorder.take(key, value, stamp)


def run(options: argparse.Namespace) -> None:
    """Raises DemonstrationError, OSError."""
    heard = topics(options.cameras, options.models)
    states = None
    if options.bag is None:
        rospy.init_node("demonstrations_record")
        states = rospy.Publisher("~state", String, queue_size=10, latch=True)

    def say(text: str) -> None:
        print(text, flush=True)
        if states is not None:
            states.publish(text)

    def feed() -> Feed:
        return of_robot(heard) if options.bag is None else of_bag(options.bag, heard)

    with contextlib.closing(feed()) as first:
        size = sizes(first, heard, options.cameras, say)
    with SetWriter(options.folder, schema_of(options.rate, size, options.models)) as writer:
        recorder = WatchingRecorder(writer, options.task, say=say)
        say("%s%s, which has %d episodes" % (RECORDING, options.folder, writer.episodes))
        record(feed(), heard, recorder, size)
        if recorder.length:
            recorder.mark(options.end)
        elif recorder.waits:
            say("nothing more is recorded: %s" % recorder.waits)


def main() -> None:
    """The program."""
    options = parse(rospy.myargv()[1:])
    try:
        run(options)
    except (DemonstrationError, OSError) as error:
        sys.exit("record: %s" % error)
