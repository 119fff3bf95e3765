# SPDX-License-Identifier: BSD-3-Clause
"""Range, sonars, accelerometers on the real physics; the screen; maintenance; the robot's status."""
import numpy as np
import pytest
from baxter_core_msgs.msg import URDFConfiguration
from baxter_maintenance_msgs.msg import CalibrateArmEnable, TareEnable
from genpy import Time
from sensor_msgs.msg import Image
from std_msgs.msg import Empty, Float32, Float64, String, UInt16

from baxter_sim_hardware.arms import procedures
from baxter_sim_hardware.sensing import sensors, sonar_lights
from baxter_sim_hardware.topics.sensors import LIGHT_TURNS, SONAR_RATE_HZ
from bullet_sim import Pose
from urdf_model import parse_urdf

HEARD = ("range/*", "/sim/laserscan/*", "analog_io/*_hand_range/*", "sonar/*", "accelerometer/*", "/robustcontroller/*",
         "/usb/*", "/updater/*", "/update/*", "/diagnostics*", "*joint_states", "limb/*endpoint_state", "urdf")

SIDES = ("left", "right")
WALL = """<robot name="wall"><link name="wall"><collision><geometry><box size="0.02 0.6 0.6"/></geometry></collision>
</link></robot>"""


def wall_before(lab, link, distance, name="wall"):
    """A wall across the x axis of a link's frame, its near side at this distance [m]."""
    matrix = lab.model.link_pose(link).matrix()
    centre = matrix.copy()
    centre[:3, 3] += (distance + 0.01) * matrix[:3, 0]
    lab.world.spawn(parse_urdf(WALL), name, Pose.from_matrix(centre), static=True)


# -- range

@pytest.mark.parametrize("side", SIDES)
def test_hand_range_measures_what_is_before_it(lab, side):
    name = "%s_hand_range" % side

    def read():
        lab.run(0.02)
        scan = lab.last("/sim/laserscan/%s/state" % name)
        return (lab.last("range/%s/state" % name).range, lab.last("analog_io/%s/state" % name).value,
                lab.last("analog_io/%s/value_uint32" % name).data, scan.ranges[0])

    assert read() == pytest.approx((65.535, 65535.0, 65535, np.inf))
    wall_before(lab, name, 0.5)
    assert read() == pytest.approx((65.535, 65535.0, 65535, np.inf))
    lab.world.delete("wall")
    wall_before(lab, name, 0.25)
    metres, millimetres, whole, scanned = read()
    assert (metres, millimetres, whole, scanned) == pytest.approx((0.25, 250.0, 250, 0.25), abs=1.0, rel=5e-3)
    assert metres == pytest.approx(0.25, abs=2e-3)
    message = lab.last("range/%s/state" % name)
    assert message.header.frame_id == name and message.radiation_type == message.INFRARED
    assert (message.min_range, message.max_range) == pytest.approx((0.004, 0.4))
    assert lab.last("analog_io/%s/state" % name).isInputOnly


def test_noisy_hands_say_counts_about_the_truth_and_the_same_for_the_same_seed(make_lab):
    said = []
    for _ in range(2):
        lab = make_lab(parameters={"enable": True, "effects": "noise", "serial": 2})
        lab.hear("range/left*", "accelerometer/left*")
        wall_before(lab, "left_hand_range", 0.25)
        lab.run(2.0)
        ranges = [message.range for message in lab.publishers["range/left_hand_range/state"].messages]
        forces = np.array([(message.linear_acceleration.x, message.linear_acceleration.y, message.linear_acceleration.z)
                           for message in lab.publishers["accelerometer/left_accelerometer/state"].messages])
        said.append((ranges, forces.tolist()))
    assert said[0] == said[1]
    millimetres = 1e3 * np.array(ranges)
    np.testing.assert_allclose(millimetres, np.round(millimetres), atol=1e-6)
    assert 1.0 < millimetres.std() < 6.0 and abs(millimetres.mean() - 250.0) < 2.0
    # 50 measurements a second, each of them published twice.
    assert len(ranges) >= 200 and np.count_nonzero(np.diff(millimetres)) <= 101
    still = forces[100:]
    np.testing.assert_allclose(still / 0.0144, np.round(still / 0.0144), atol=1e-6)
    assert 0.015 < still.std(axis=0).max() < 0.06
    assert np.linalg.norm(still.mean(axis=0)) == pytest.approx(9.81, abs=0.02)


@pytest.mark.parametrize("hit, reported", [(None, 65.535), (0.0, 0.004), (0.1, 0.1), (0.4, 0.4)])
def test_range_from_hit(hit, reported):
    assert sensors.range_from_hit(hit) == reported


# -- sonar

def heard(lab):
    """{sensor: distance} of the last cloud, after a look at its points."""
    lab.run(0.2)
    cloud = lab.last("sonar/head_sonar/state")
    assert cloud.header.frame_id == "sonar_ring"
    assert [channel.name for channel in cloud.channels] == ["SensorId", "Distance"]
    ids, distances = (channel.values for channel in cloud.channels)
    for point, sensor, distance in zip(cloud.points, ids, distances, strict=True):
        assert np.linalg.norm((point.x, point.y, point.z)) == pytest.approx(distance, abs=1e-3)
        assert np.arctan2(point.y, point.x) % (2 * np.pi) == pytest.approx(sensor * np.pi / 6, abs=1e-3)
    return dict(zip(map(int, ids), distances, strict=True))


def test_sonars_hear_a_wall_and_can_be_switched_off(make_lab):
    lab = make_lab(pose="start")
    nothing = heard(lab)
    assert 0 not in nothing
    wall_before(lab, "sonar_ring", 2.0)
    assert heard(lab)[0] == pytest.approx(2.0, abs=0.05)
    assert lab.last("sonar/head_sonar/sonars_enabled").data == 4095
    assert lab.last("sonar/head_sonar/lights/state").data & 1
    lab.send("sonar/head_sonar/set_sonars_enabled", UInt16(4094))
    assert 0 not in heard(lab)
    assert lab.last("sonar/head_sonar/sonars_enabled").data == 4094
    lab.send("sonar/head_sonar/set_sonars_enabled", UInt16(4096))
    lab.run(0.1)
    assert "must be from 0 to 4095" in lab.log.lines[-1]


def test_without_a_client_every_light_follows_its_sonar(make_lab):
    lab = make_lab(pose="start")
    wall_before(lab, "sonar_ring", 2.0)
    lab.run((LIGHT_TURNS + 0.5) / SONAR_RATE_HZ)
    shown = lab.lights["sonar_ring"].pixels.copy()
    lab.run(0.15)
    mask = lab.last("sonar/head_sonar/lights/state").data
    assert mask & 1, "the wall is before the first sonar"
    np.testing.assert_array_equal(shown, sonar_lights.picture(mask, 0.0, 0.0))


def test_lights_and_levels(make_lab):
    lab = make_lab(pose="start")
    lab.send("sonar/head_sonar/lights/set_lights", UInt16(0x8FFF))
    lab.send("sonar/head_sonar/lights/set_green_level", Float32(40.0))
    lab.send("sonar/head_sonar/lights/set_red_level", Float32(400.0))
    lab.run(0.15)
    assert lab.last("sonar/head_sonar/lights/state").data == 0x8FFF
    assert lab.last("sonar/head_sonar/lights/green_level").data == 40.0
    assert lab.last("sonar/head_sonar/lights/red_level").data == 0.0
    assert any("red level is 400" in line for line in lab.log.lines)
    lab.run(0.3)
    assert not lab.last("sonar/head_sonar/lights/state").data & 0x8000


# -- accelerometers

@pytest.mark.parametrize("side", SIDES)
def test_accelerometer_feels_gravity_and_motion(lab, side):
    topic = "accelerometer/%s_accelerometer/state" % side
    lab.run(0.1)

    def force():
        vector = lab.last(topic).linear_acceleration
        return lab.model.link_pose("%s_hand_accelerometer" % side).matrix()[:3, :3] @ (vector.x, vector.y, vector.z)

    np.testing.assert_allclose(force(), (0.0, 0.0, 9.81), atol=0.05)
    message = lab.last(topic)
    assert message.header.frame_id == "%s_hand_accelerometer" % side
    assert message.orientation_covariance[0] == message.angular_velocity_covariance[0] == -1.0
    # Begin to turn at the shoulder: the hand accelerates sideways by 10 rad/s^2 times its distance from the axis.
    lab.command(2, [1.0], names=["%s_s0" % side])
    felt, moved, before = [], [], lab.model.link_twist("%s_hand_accelerometer" % side)[0]
    for _ in range(10):
        lab.run(0.01)
        felt.append(force() - (0.0, 0.0, 9.81))
        after = lab.model.link_twist("%s_hand_accelerometer" % side)[0]
        moved.append((after - before) / 0.01)
        before = after
    np.testing.assert_allclose(np.mean(felt, axis=0), np.mean(moved, axis=0), atol=1.5)
    assert np.linalg.norm(np.mean(moved, axis=0)) > 3.0


# -- screen

def picture(width, height, encoding, value, step=None):
    channels = {"mono8": 1, "bgra8": 4}.get(encoding, 3)
    return Image(width=width, height=height, encoding=encoding, step=step or width * channels,
                 data=bytes([*value]) * (width * height))


def shown(lab):
    lab.publishers["sim/screen"].has_listeners = True
    lab.run(0.2)
    message = lab.last("sim/screen")
    assert (message.width, message.height, message.encoding) == (1024, 600, "rgb8")
    return np.frombuffer(message.data, dtype=np.uint8).reshape(600, 1024, 3)


@pytest.mark.parametrize("encoding, value, colour", [
    ("bgr8", (1, 2, 3), (3, 2, 1)), ("8UC3", (1, 2, 3), (3, 2, 1)), ("rgb8", (1, 2, 3), (1, 2, 3)),
    ("bgra8", (1, 2, 3, 255), (3, 2, 1)), ("mono8", (7,), (7, 7, 7))])
def test_a_picture_is_shown_from_the_upper_left_corner_and_stays(make_lab, encoding, value, colour):
    lab = make_lab()
    lab.hear()
    assert not shown(lab).any()
    lab.send("xdisplay", picture(100, 50, encoding, value))
    lab.run(0.2)
    pixels = shown(lab)
    assert (pixels[:50, :100] == colour).all() and not pixels[50:].any() and not pixels[:, 100:].any()
    assert np.array_equal(lab.drawn.pixels, pixels)
    lab.plugin.reset()
    assert not lab.drawn.pixels.any()


def test_pictures_are_on_the_glass(make_lab):
    drawn = make_lab().drawn
    assert drawn.link == "display" and drawn.size_m == pytest.approx((0.218, 0.218 * 600 / 1024))
    # 15 degrees back from the link's z, half of the glass and half a millimetre out.
    assert drawn.place[:3, 2] == pytest.approx([0.0, -np.sin(np.radians(15)), np.cos(np.radians(15))])
    assert drawn.place[:3, 3] @ drawn.place[:3, 2] == pytest.approx(0.001)


@pytest.mark.parametrize("message, reason", [
    (picture(1025, 10, "bgr8", (1, 2, 3)), "1025 x 10 pixels; the screen has 1024 x 600"),
    (picture(0, 10, "bgr8", (1, 2, 3)), "0 x 10 pixels"),
    (picture(10, 10, "16UC1", (1, 2, 3)), "encoding '16UC1'; choices are"),
    (picture(10, 10, "bgr8", (1,)), "100 bytes, 30 a row"),
    (picture(10, 10, "bgr8", (1, 2, 3), step=5), "5 a row")])
def test_a_senseless_picture_is_refused(make_lab, message, reason):
    lab = make_lab()
    lab.hear()
    lab.send("xdisplay", message)
    assert not shown(lab).any()
    assert reason in lab.log.lines[-1]


# -- maintenance

@pytest.fixture
def quiet_lab(lab):
    """Procedures take long, and only what they say of themselves is read."""
    lab.hear("/robustcontroller/*")
    return lab


def ask(lab, name, side, wanted):
    kind = {"Tare": TareEnable, "CalibrateArm": CalibrateArmEnable}[name]
    lab.send("/robustcontroller/%s/%s/enable" % (side, name), kind(isEnabled=wanted, uid="sdk"))


def status(lab, name, side):
    return lab.last("/robustcontroller/%s/%s/status" % (side, name))


def run_to_the_end(lab, name, side, before, limit_s):
    """Until the procedure has ended, or for so long."""
    end_s = lab.world.time_s + limit_s
    while status(lab, name, side).complete == 0 and lab.world.time_s < end_s:
        lab.run(0.5, before=before)


def keep_asking(name, side):
    def ask_twice_a_second(lab):
        if lab.world.tick % 250 == 0:
            ask(lab, name, side, True)

    return ask_twice_a_second


@pytest.mark.parametrize("name, side", [("Tare", "left"), ("CalibrateArm", "right")])
def test_a_procedure_runs_its_dialogue(quiet_lab, name, side):
    lab = quiet_lab
    lab.run(0.2)
    assert not status(lab, name, side).isEnabled
    lab.run(1.0, before=keep_asking(name, side))
    assert status(lab, name, side).isEnabled and status(lab, name, side).complete == 0
    assert status(lab, name, side).controlUid == "sdk"
    # The arm moves through its postures and rests in each; the other arm does not move.
    joints = slice(0, 7) if side == "left" else slice(7, 14)
    start, path, begin = lab.position, [], lab.world.time_s
    while status(lab, name, side).complete == 0 and lab.world.time_s < begin + 100.0:
        lab.run(0.1, before=keep_asking(name, side))
        path.append(lab.position)
    assert status(lab, name, side).isEnabled and status(lab, name, side).complete == 2, status(lab, name, side)
    way = procedures.postures(name, side)
    assert lab.world.time_s - begin > procedures.REST_S * len(way) - 1.0
    path = np.array(path)
    for posture in way:
        assert (np.abs(path[:, joints] - posture).max(axis=1) < procedures.NEAR_RAD).sum() > 20
    other = np.delete(np.arange(14), np.arange(14)[joints])
    assert np.abs(path[:, other] - start[other]).max() < 1e-3
    ask(lab, name, side, False)
    lab.run(0.2)
    assert not status(lab, name, side).isEnabled
    others = [(n, s) for n in ("Tare", "CalibrateArm") for s in SIDES if (n, s) != (name, side)]
    assert not any(status(lab, *other).isEnabled for other in others)


def test_taring_a_physical_arm_takes_longer_and_succeeds(make_lab):
    lab = make_lab(parameters={"enable": True, "profile": "robot"})
    lab.hear("/robustcontroller/*/Tare/*")
    lab.run(1.0, before=keep_asking("Tare", "left"))
    begin = lab.world.time_s
    while status(lab, "Tare", "left").complete == 0 and lab.world.time_s < begin + 100.0:
        lab.run(0.1, before=keep_asking("Tare", "left"))
    assert status(lab, "Tare", "left").complete == 2, status(lab, "Tare", "left")
    assert 12.0 < lab.world.time_s - begin < 40.0


def test_a_procedure_whose_client_goes_away_times_out(quiet_lab):
    lab = quiet_lab
    ask(lab, "Tare", "left", True)
    lab.run(1.0)
    assert status(lab, "Tare", "left").isEnabled
    lab.run(1.0)
    assert not status(lab, "Tare", "left").isEnabled and status(lab, "Tare", "left").timedOut


def test_a_procedure_fails_on_a_disabled_robot(make_lab):
    lab = make_lab()
    lab.run(0.5, before=keep_asking("CalibrateArm", "right"))
    assert status(lab, "CalibrateArm", "right").complete == 1
    assert status(lab, "CalibrateArm", "right").errorCodes == ["the robot is disabled"]


def test_a_tare_fails_when_something_leans_on_the_arm(quiet_lab):
    lab = quiet_lab
    go_on = keep_asking("Tare", "left")

    def lean(lab):
        go_on(lab)
        lab.model.apply_wrench("left_gripper", (0.0, 0.0, -10.0),
                               position=lab.model.link_pose("left_gripper").position)

    lab.run(0.5, before=lean)
    run_to_the_end(lab, "Tare", "left", lean, 25.0)
    assert status(lab, "Tare", "left").complete == 1
    assert "feels" in status(lab, "Tare", "left").errorCodes[0]


def test_a_tare_that_is_ended_stops_the_arm(quiet_lab):
    lab = quiet_lab
    lab.run(1.0, before=keep_asking("Tare", "left"))
    go_on = keep_asking("Tare", "left")
    for _ in range(100):
        lab.run(0.1, before=go_on)
        if np.abs(lab.velocity[:7]).max() > 0.3:
            break
    ask(lab, "Tare", "left", False)
    lab.run(0.4)
    where = lab.position
    lab.run(1.0)
    assert np.abs(lab.position - where).max() < 1e-3
    assert np.abs(lab.position[:7] - procedures.postures("Tare", "left")[1]).max() > 0.02
    assert status(lab, "Tare", "left").complete == 0 and not status(lab, "Tare", "left").isEnabled


def test_a_tare_whose_arm_is_held_fails(quiet_lab):
    lab = quiet_lab
    lab.send("limb/left/set_speed_ratio", Float64(0.0))
    lab.run(0.5, before=keep_asking("Tare", "left"))
    run_to_the_end(lab, "Tare", "left", keep_asking("Tare", "left"), 40.0)
    assert status(lab, "Tare", "left").complete == 1
    assert "s1 is 0.30 rad off its posture" in status(lab, "Tare", "left").errorCodes[0]


def test_updater_has_nothing_to_update_from(make_lab):
    lab = make_lab()
    lab.run(1.1)
    assert lab.last("/usb/update_sources").sources == []
    assert lab.last("/updater/status").status == 0
    lab.send("/updater/start", String("abc"))
    lab.run(1.1)
    assert lab.last("/updater/status").status == 1 and "no update 'abc'" in lab.last("/updater/status").long_description
    assert lab.last("/update/status").data == 1
    lab.send("/updater/stop", Empty())
    lab.run(1.1)
    assert lab.last("/updater/status").status == 0


# -- the robot's status

def test_diagnostics_follow_the_robots_state(lab):
    lab.run(1.1)
    names = [each.name for each in lab.last("/diagnostics").status]
    assert names == ["state", "left arm", "right arm"]
    assert lab.last("/diagnostics_toplevel_state").level == 0
    lab.stop()
    lab.run(1.1)
    assert [each.level for each in lab.last("/diagnostics").status] == [2, 0, 0]
    assert lab.last("/diagnostics_toplevel_state").level == 2
    aggregate = lab.last("/diagnostics_agg").status
    assert aggregate[0].name == "/Baxter" and aggregate[0].level == 2
    assert [each.name for each in aggregate[1:]] == ["/Baxter/" + name for name in names]


def test_set_points_are_published(lab):
    lab.command(1, lab.position + 0.2)
    lab.run(0.1)
    set_points, measured = lab.last("ref_joint_states"), lab.last("joint_states")
    arms = [name for name in measured.name if name.startswith(SIDES)]
    assert set_points.name == arms
    wanted = dict(zip(measured.name, measured.position, strict=True))
    np.testing.assert_allclose(set_points.position, [wanted[name] for name in arms], atol=0.03)
    assert np.abs(set_points.velocity).min() > 0.1
    for side in SIDES:
        here, there = (lab.last("limb/%s/%s" % (side, name)) for name in ("endpoint_state", "commanded_endpoint_state"))
        assert there.header.frame_id == "base"
        assert there.pose.position.x == pytest.approx(here.pose.position.x, abs=0.02)
        assert there.twist.linear.z == pytest.approx(here.twist.linear.z, abs=0.05)


FRAGMENT = '<robot name="tool"><link name="tool"/></robot>'


def test_a_urdf_fragment_is_passed_on_once(make_lab):
    lab = make_lab()
    sent = lab.publishers["urdf"].messages
    assert len(sent) == 1 and sent[0].link == ""
    fragment = URDFConfiguration(Time(3), "left_hand", "left_gripper_base", FRAGMENT)
    for _ in range(5):
        lab.send("urdf", fragment)
        lab.run(0.01)
    assert lab.publishers["urdf"].messages[1:] == [fragment]


@pytest.mark.parametrize("link, joint, xml, reason", [
    ("nose", "j", FRAGMENT, "link 'nose'"), ("left_hand", "", FRAGMENT, "names no joint"),
    ("left_hand", "j", "<robot", "is not XML"), ("left_hand", "j", "<model/>", "is <model>; it must be a <robot>")])
def test_a_senseless_urdf_fragment_is_refused(make_lab, link, joint, xml, reason):
    lab = make_lab()
    lab.send("urdf", URDFConfiguration(Time(3), link, joint, xml))
    lab.run(0.01)
    assert reason in lab.log.lines[-1] and len(lab.publishers["urdf"].messages) == 1
