# SPDX-License-Identifier: BSD-3-Clause
"""A robot's messages become frames on an exact grid; marks keep and drop episodes; silence is named."""
import json

import numpy as np
import pytest
import rosbag
import rospy
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorState
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from baxter_model import SIDES, joint_names
from demonstrations.frames import ACTION, ENVIRONMENT, PICTURES, STATE, DemonstrationError, Episode, Schema, numbers
from demonstrations.needed import need
from demonstrations.over_ros import messages, recording
from demonstrations.reading import DataSet
from demonstrations.replaying import Replay, ReplayLimits, actions_of, reason_to_stop
from demonstrations.watching import JOINT_ANGLES, MODEL, NAMED, OPENING, SET_POINTS, TOLD, WatchingRecorder, schema_of
from demonstrations.writing import SetWriter

ARMS = [name for side in SIDES for name in joint_names(side)]


class Told(list):
    def __call__(self, text):
        self.append(text)

    def has(self, *words):
        return any(all(word in text for word in words) for text in self)


@pytest.fixture
def robot(tmp_path):
    """A recorder at 20 Hz of a robot whose joints are at their time in seconds, with joint states at 100 Hz."""
    class Robot:
        def __init__(self):
            self.said, self.folder = Told(), tmp_path / "set"
            self.writer = SetWriter(self.folder, schema_of(20, {"head": (4, 6)}, ["block"]))
            self.recorder = WatchingRecorder(self.writer, "Show it.", 0.3, self.said)
            self.tick = 0

        def goes(self, seconds, without=()):
            for _ in range(round(100 * seconds)):
                stamp = self.tick / 100.0
                for key, value in ((SET_POINTS, [stamp + 1.0] * 14), (OPENING % "left", 30.0),
                                   (OPENING % "right", 60.0), (MODEL % "block", [stamp] * 7),
                                   ("head", np.full((4, 6, 3), self.tick % 200, np.uint8))):
                    if key not in without:
                        self.recorder.take(key, value)
                self.recorder.take(JOINT_ANGLES, [stamp] * 14, stamp)
                self.tick += 1

    made = Robot()
    yield made
    made.writer.close()


def test_frames_are_on_the_grid_whatever_the_rates_of_what_comes(robot):
    robot.goes(1.0)
    robot.recorder.take(TOLD % "right", 0.0)
    robot.goes(1.0)
    robot.recorder.mark("success")
    robot.recorder.mark("failure")
    data = DataSet(robot.folder)
    assert len(data) == 1 and data.tasks == ["Show it."] and robot.said.has("nothing to keep")
    columns = data.episode(0).columns
    times = columns[STATE][:, 0]
    np.testing.assert_allclose(np.diff(times), 0.05, atol=1e-6)
    assert 38 <= len(times) <= 40
    np.testing.assert_allclose(columns[ACTION][:, 0], times + 1.0, atol=0.011)
    np.testing.assert_allclose(columns[ENVIRONMENT][:, 3], times, atol=0.011)
    right = [name for name, _ in NAMED].index("right_gripper.pos")
    assert set(columns[STATE][:, right]) == {60.0} and set(columns[ACTION][:, right]) == {60.0, 0.0}
    assert columns[ACTION][-1, right] == 0.0 and columns[ACTION][0, right - 8] == 30.0
    data.check(0)


def test_marks_end_episodes_and_the_next_begins(robot):
    robot.goes(0.5)
    robot.recorder.mark("failure")
    robot.goes(0.4)
    robot.recorder.mark("again")
    robot.recorder.mark("perhaps")
    robot.goes(0.6)
    robot.recorder.mark("success")
    data = DataSet(robot.folder)
    assert [data.episode(number).success for number in range(len(data))] == [False, True]
    assert robot.said.has("thrown away") and robot.said.has("perhaps", "success, failure, again")


def test_what_is_missing_is_named_and_ends_an_episode(robot):
    robot.goes(0.5, without=("head", MODEL % "block"))
    assert robot.recorder.length == 0 and robot.recorder.waits == "waiting for head, model block"
    robot.goes(0.5)
    assert robot.recorder.length and robot.recorder.waits == ""
    robot.goes(0.5, without=("head",))
    assert robot.recorder.length == 0 and robot.said.has("dropped", "head")


@pytest.mark.parametrize(("ticks", "text"), [(100, "no joint states for 1.0"), (-20, "time went back")])
def test_time_that_jumps_ends_an_episode(robot, ticks, text):
    robot.goes(0.5)
    robot.tick += ticks
    robot.goes(0.5)
    assert robot.said.has("dropped", text)
    robot.recorder.mark("success")
    columns = DataSet(robot.folder).episode(0).columns
    np.testing.assert_allclose(np.diff(columns[STATE][:, 0]), 0.05, atol=1e-6)


def states(stamp):
    return JointState(header=rospy.Header(stamp=rospy.Time.from_sec(stamp)), name=[*ARMS[::-1], "head_pan"],
                      position=[*np.linspace(1.3, 0.0, 14), stamp])


@pytest.fixture
def bag(tmp_path):
    """Two seconds with a camera; the mark comes after one second."""
    path = tmp_path / "shown.bag"
    image = Image(height=5, width=6, encoding="bgr8", step=18, data=bytes([1, 2, 3] * 30))
    with rosbag.Bag(str(path), "w") as file:
        for tick in range(200):
            stamp = 5.0 + tick / 100.0
            said = [("/robot/joint_states", JointState(name=["l_finger"], position=[0.0])),
                    ("/robot/ref_joint_states", states(stamp)), ("/cameras/head_camera/image", image),
                    ("/robot/joint_states", states(stamp))]
            said += [("/robot/end_effector/%s_gripper/state" % side, EndEffectorState(position=40.0)) for side in SIDES]
            if tick == 50:
                said.append(("/robot/end_effector/left_gripper/command", EndEffectorCommand(command="grip")))
            if tick == 100:
                said.append((messages.MARKS_TOPIC, String("success")))
            for topic, message in said:
                file.write(topic, message, rospy.Time.from_sec(stamp))
    return path


@pytest.mark.parametrize(("end", "count"), [("again", 1), ("failure", 2)])
def test_a_recording_of_rosbag_becomes_a_set(bag, tmp_path, capsys, end, count):
    recording.run(recording.parse([str(tmp_path / "set"), "--task", "Show it.", "--cameras", "head", "--bag", str(bag),
                                   "--end", end]))
    data = DataSet(tmp_path / "set")
    assert len(data) == count and data.episode(0).success and "episode 0 is kept" in capsys.readouterr().out
    columns = data.episode(0).columns
    assert 18 <= len(columns[STATE]) <= 20
    joints = [n for n in range(16) if n % 8 != 7]
    np.testing.assert_allclose(columns[STATE][3][joints], np.linspace(0.0, 1.3, 14), atol=1e-6)
    assert columns[ACTION][0, 7] == 40.0 and columns[ACTION][-1, 7] == 0.0
    pixels = next(data.pictures(0, PICTURES + "head"))
    assert pixels.shape == (4, 6, 3) and np.abs(pixels[0, 0] - np.array((3, 2, 1))).max() < 12


@pytest.mark.parametrize("content", [None, b"", b"#ROSBAG V2.0\n", b"no bag at all"])
def test_a_file_that_is_no_recording_is_named(tmp_path, content):
    path = tmp_path / "broken.bag"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DemonstrationError, match="broken.bag"):
        recording.run(recording.parse([str(tmp_path / "set"), "--task", "Show it.", "--bag", str(path)]))


def test_a_recording_without_the_camera_is_named(bag, tmp_path):
    with pytest.raises(DemonstrationError, match="/cameras/left_hand_camera/image"):
        recording.run(recording.parse([str(tmp_path / "set"), "--task", "Show it.", "--cameras", "left_hand", "--bag",
                                       str(bag)]))


@pytest.mark.parametrize(("command", "args", "opening"), [
    ("grip", "", 0.0), ("release", "", 100.0), ("go", json.dumps({"position": 150}), 100.0), ("go", "{", None),
    ("calibrate", "", None)])
def test_commands_of_grippers_say_how_far_they_open(command, args, opening):
    assert messages.opening_told(EndEffectorCommand(command=command, args=args)) == opening


def test_a_replay_goes_to_the_start_and_then_as_recorded():
    actions = np.zeros((5, 16))
    actions[:, 0] = (0.5, 0.6, 0.7, 0.7, 0.7)
    actions[3:, 7] = 100.0
    replay = Replay(actions, 10, np.array([0.2, *[0.0] * 13]), ReplayLimits(speed_rad_s=0.3))
    assert replay.begins_s == pytest.approx(1.0) and replay.ends_s == pytest.approx(1.4)
    places = [replay.joints(time_s)[0] for time_s in (0.0, 0.5, 1.0, 1.05, 1.1, 1.4, 9.0)]
    assert places == pytest.approx([0.2, 0.35, 0.5, 0.55, 0.6, 0.7, 0.7])
    assert [replay.openings(time_s)[0] for time_s in (0.0, 1.25, 1.35, 9.0)] == [0.0, 0.0, 100.0, 100.0]


@pytest.mark.parametrize(("found", "text"), [
    ((False, False, 0.0, 0.0), "enabled"), ((True, True, 0.0, 0.0), "stop"), ((True, False, 0.6, 0.0), "0.6 s old"),
    ((True, False, 0.0, 0.7), "0.70 rad")])
def test_a_replay_ends_where_the_robot_cannot_follow(found, text):
    assert text in reason_to_stop(ReplayLimits(), *found)
    assert reason_to_stop(ReplayLimits(), True, False, 0.1, 0.1) == ""


def test_a_set_of_other_actions_is_not_replayed_on_a_robot(tmp_path):
    schema = Schema(20, {ACTION: numbers([("left_hand.dx", "")])}, about={"task": "Reach"})
    with SetWriter(tmp_path, schema) as writer:
        writer.add(Episode("Reach.", {ACTION: np.zeros((2, 1), np.float32)}, True, 0))
    with pytest.raises(DemonstrationError, match="left_hand.dx"):
        actions_of(DataSet(tmp_path), 0)


def test_an_episode_with_a_number_that_is_none_does_not_move_a_robot(tmp_path):
    with SetWriter(tmp_path, Schema(20, {ACTION: numbers(NAMED)}, about={"task": "Reach"})) as writer:
        writer.add(Episode("Reach.", {ACTION: np.zeros((3, len(NAMED)), np.float32)}, True, 0))
    pyarrow, parquet = need("pyarrow"), need("pyarrow", "parquet")
    file, = tmp_path.glob("data/**/*.parquet")
    table = parquet.read_table(file)
    values = np.zeros((3, len(NAMED)), np.float32)
    values[1, 4] = np.nan  # as others may write it; ours does not
    column = pyarrow.array(list(values), type=table.schema.field(ACTION).type)
    parquet.write_table(table.set_column(table.schema.names.index(ACTION), table.schema.field(ACTION), column), file)
    with pytest.raises(DemonstrationError, match="finite"):
        actions_of(DataSet(tmp_path), 0)


def test_a_recording_with_other_messages_on_a_topic_is_named(tmp_path):
    with rosbag.Bag(str(tmp_path / "x.bag"), "w") as file:
        file.write("/robot/joint_states", String("s0"), rospy.Time(5))
    with pytest.raises(DemonstrationError, match="std_msgs/String, expected sensor_msgs/JointState"):
        list(recording.of_bag(tmp_path / "x.bag", messages.topics([], [])))


def test_a_feed_of_a_robot_that_nobody_reads_any_more_holds_up_no_topic(monkeypatch):
    listening = []

    class Subscriber:
        def __init__(self, topic, kind, callback, **_options):
            listening.append(self)
            callback(kind())

        def unregister(self):
            listening.remove(self)

    monkeypatch.setattr(rospy, "Subscriber", Subscriber)
    feed = recording.of_robot({"/steering/mark": messages.Heard(String, lambda message: [])})
    assert next(feed)[0] == "/steering/mark" and listening
    feed.close()
    assert not listening
