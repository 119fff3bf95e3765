# SPDX-License-Identifier: BSD-3-Clause
"""The effect `safety`: an arm that collides stops, arms keep away from each other, each function can be suppressed."""
import numpy as np
import pytest
from bullet_sim_msgs.srv import PressRequest
from std_msgs.msg import Empty

from baxter_model import JOINTS, SIDES, poses
from baxter_model.names import MIRROR_SIGNS
from baxter_model.self_collision import BODY
from baxter_sim_hardware import effects
from baxter_sim_hardware.arms import avoidance, collision
from baxter_sim_hardware.arms.safety import blocks_of
from baxter_sim_hardware.errors import BaxterHardwareError
from bullet_sim import Pose
from bullet_sim.mesh_loading import load_scene
from model_files.resources import ResourceFinder
from urdf_model import parse_urdf

HEARD = ("limb/*/collision_*_state",)

POSITION, VELOCITY, TORQUE, RAW = 1, 2, 3, 4
LEFT = ["left_" + joint for joint in JOINTS]
NAMES = ["%s_%s" % (side, joint) for side in SIDES for joint in JOINTS]
S1 = 1
# Bent, the hand in front.
BENT = np.tile([0.0, -0.3, 0.0, 0.9, 0.0, 0.9, 0.0], 2)
TABLE = """<robot name="table"><link name="table"><collision><geometry><box size="0.6 0.6 0.1"/></geometry></collision>
<inertial><mass value="30"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def suppress(lab, *kinds):
    """Send a suppress message of these kinds to both arms, ten times a second."""
    if lab.world.tick % 50 == 0:
        for kind in kinds:
            for side in SIDES:
                lab.send("limb/%s/%s" % (side, kind), Empty())


def reported(lab, side="left"):
    return lab.last("limb/%s/collision_detection_state" % side).collision_state


@pytest.fixture()
def above_a_table(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "lag,safety"}, angles=BENT)
    tip = lab.model.link_pose("left_gripper").position
    place = Pose((tip[0], tip[1], tip[2] - 0.17), (0.0, 0.0, 0.0, 1.0))
    lab.world.spawn(parse_urdf(TABLE), "table", place, static=True)
    lab.run(0.3)
    return lab


class Press:
    """Both sides of a contact: s1 of the left arm is sent down at 0.3 rad/s until some time after it.

    Attributes: contact_s, stopped_s, reported_s: when [s]; force: [N] of each tick since contact.
    """

    def __init__(self, lab, mode, seconds=0.6, kinds=()):
        self.contact_s = self.stopped_s = self.reported_s = None
        self.force = []
        start, begin = lab.position[:7], lab.world.time_s
        rate = np.eye(7)[S1] * 0.3

        def before(lab):
            suppress(lab, *kinds)
            if lab.world.tick % 5 == 0:
                since = lab.world.time_s - begin
                lab.command(mode, rate if mode == VELOCITY else start + rate * since, LEFT)

        while self.contact_s is None or lab.world.time_s < self.contact_s + seconds:
            assert lab.world.time_s < begin + 3.0, "no contact"
            lab.run(0.002, before)
            self._look(lab)

    def _look(self, lab):
        force = sum(contact.force for contact in lab.world.contacts(lab.model, lab.world.models["table"]))
        if force > 0.0 and self.contact_s is None:
            self.contact_s = lab.world.time_s
        if self.contact_s is not None:
            self.force.append(force)
            if self.stopped_s is None and lab.plugin._baxter.halted("left"):
                self.stopped_s = lab.world.time_s
            if self.reported_s is None and reported(lab):
                self.reported_s = lab.world.time_s


def static_force(lab):
    """[N] on the table when the drive of s1 pushes with its limit, and the arm lies on it besides."""
    shoulder = lab.plugin._arms._chains["left"].joint_frames(lab.position[:7])[1][S1]
    hand = lab.plugin._arms._chains["left"].fk(lab.position[:7])[:3, 3]
    lever = np.hypot(*(hand - shoulder)[:2])
    weight = lab.model.gravity_efforts()[lab.arm][S1]
    return (50.0 + (37.3 + 24.3 * lab.position[S1]) - weight) / lever


@pytest.mark.parametrize("mode", [VELOCITY, RAW])
def test_an_arm_driven_into_a_table_stops_and_says_so(above_a_table, mode):
    lab = above_a_table
    pressed = Press(lab, mode)
    assert pressed.stopped_s - pressed.contact_s < 0.05
    assert pressed.reported_s - pressed.contact_s < 0.05
    assert max(pressed.force) < 2.0 * static_force(lab), (max(pressed.force), static_force(lab))
    # It does not lean on the table afterwards.
    assert np.mean(pressed.force[-100:]) < 30.0
    assert not reported(lab, "right")
    assert any("left limb stops, a collision: " in line for line in lab.log.lines)
    assert any("has collided and stands" in line for line in lab.log.lines)


def test_after_two_seconds_it_obeys_again(above_a_table):
    lab = above_a_table
    pressed = Press(lab, VELOCITY, seconds=0.1)
    lab.run(pressed.stopped_s + 1.95 - lab.world.time_s)
    rest = lab.position
    lab.command(POSITION, rest - 0.2 * np.tile(np.eye(7)[S1], 2), None)
    lab.run(0.03)
    assert reported(lab) and abs(lab.position[S1] - rest[S1]) < 0.005
    lab.run(0.1)
    assert not reported(lab)
    lab.command(POSITION, rest - 0.2 * np.tile(np.eye(7)[S1], 2))
    lab.run(0.7)
    assert lab.position[S1] < rest[S1] - 0.1


def test_suppressed_detection_lets_the_arm_press(above_a_table):
    lab = above_a_table
    # The set-point goes on into the table at 0.3 rad/s, and s1 has some 130 Nm/rad.
    pressed = Press(lab, RAW, seconds=1.2, kinds=(collision.CONTACT, collision.OVERWRENCH))
    assert pressed.stopped_s is None and pressed.reported_s is None
    assert np.mean(pressed.force[-50:]) > 60.0


@pytest.mark.parametrize("kinds, stops", [((collision.CONTACT,), True),
                                          ((collision.CONTACT, collision.OVERWRENCH), False)])
def test_a_hand_that_feels_too_much_stops_its_arm(make_lab, kinds, stops):
    """A push along the line from the shoulder: joints feel little of it."""
    lab = make_lab(parameters={"enable": True, "effects": "safety"})
    lab.run(0.1)

    def push(lab):
        suppress(lab, *kinds)
        link = lab.model.link_pose("left_gripper")
        lab.model.apply_wrench("left_gripper", (0.0, 0.0, -130.0), position=link.position)

    for kind in kinds:
        lab.send("limb/left/" + kind, Empty())
    lab.run(0.2, before=push)
    assert lab.plugin._baxter.halted("left") == reported(lab) == stops
    assert not lab.plugin._baxter.halted("right")


def test_fast_motion_in_free_space_is_no_collision(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "lag,safety"}, angles=BENT)
    for way in (0.5, -0.5, 0.5):
        lab.command(RAW, lab.position + way * np.tile([1.0, -0.8, 1.5, 1.0, 1.5, -1.0, 1.5], 2))
        lab.run(0.4)
    assert not any("collision" in line for line in lab.log.lines)


def own_contacts(lab):
    return [contact for contact in lab.world.contacts(lab.model, lab.model)
            if contact.distance <= 0.0 or contact.force > 0.0]


def cross(lab, mode, kinds=()):
    """Turn both arms, stretched out, towards each other; returns how many ticks had contacts within the robot."""
    touching = []
    names = ["left_s0", "right_s0"]

    def before(lab):
        suppress(lab, *kinds)
        if lab.world.tick % 25 == 0:
            lab.command(mode, [-1.5, 1.5] if mode == POSITION else [-0.6, 0.6], names)

    for kind in kinds:
        for side in SIDES:
            lab.send("limb/%s/%s" % (side, kind), Empty())
    lab.run(3.5, before, lambda lab: touching.append(bool(own_contacts(lab))))
    return sum(touching)


@pytest.mark.parametrize("effects, mode", [("lag,safety", POSITION), ("safety", VELOCITY)])
def test_arms_driven_towards_each_other_stop_before_they_touch(make_lab, effects, mode):
    lab = make_lab(angles=np.zeros(14), meshes=True, parameters={"enable": True, "effects": effects})
    assert cross(lab, mode) == 0
    assert np.abs(lab.velocity).max() < 0.05
    for side, other in (SIDES, SIDES[::-1]):
        state = lab.last("limb/%s/collision_avoidance_state" % side)
        assert state.other_arm and all(name.startswith(other) for name in state.collision_object)
        assert not reported(lab, side)
    apart = lab.position
    lab.command(POSITION, np.zeros(14))
    lab.run(1.0)
    assert (np.abs(lab.position - apart)[[0, 7]] > 0.1).all(), "the way back is free"


def test_suppressed_avoidance_lets_the_arms_touch(make_lab):
    lab = make_lab(angles=np.zeros(14), meshes=True, parameters={"enable": True, "effects": "safety"})
    assert cross(lab, POSITION, (collision.AVOIDANCE, collision.CONTACT, collision.OVERWRENCH)) > 100


# Where arms meet the body on the way from neutral: the forearm folds back onto the chest, the hand comes down on the
# pedestal.
ONTO_BODY = {"torso": {"s0": -1.7, "s1": -0.3, "e1": 2.6}, "pedestal": {"s0": -1.7, "s1": 1.0, "e1": 1.9, "w1": 0.3}}


def approach(lab, mode, side, goal, kinds=()):
    """Send one arm towards its own body for 4 s; returns how many ticks had contacts with it."""
    touching = []
    names = ["%s_%s" % (side, joint) for joint in goal]
    values = np.array(list(goal.values())) * [MIRROR_SIGNS[joint] if side == "right" else 1.0 for joint in goal]

    def before(lab):
        suppress(lab, *kinds)
        if lab.world.tick % 25 == 0:
            ahead = values - lab.position[[NAMES.index(name) for name in names]]
            lab.command(mode, values if mode == POSITION else 0.5 * np.clip(ahead, -1.0, 1.0), names)

    for kind in kinds:
        lab.send("limb/%s/%s" % (side, kind), Empty())
    lab.run(4.0, before, lambda lab: touching.append(any(BODY in (contact.link_a, contact.link_b)
                                                         for contact in own_contacts(lab))))
    return sum(touching)


@pytest.mark.parametrize("part", ONTO_BODY)
@pytest.mark.parametrize("effects, mode, side", [("lag,safety", POSITION, "left"), ("safety", VELOCITY, "right")])
def test_an_arm_driven_towards_its_own_body_stops_before_it_touches(make_lab, effects, mode, side, part):
    lab = make_lab(meshes=True, parameters={"enable": True, "effects": effects})
    lab.run(0.02)
    assert not lab.last("limb/%s/collision_avoidance_state" % side).collision_object
    start = lab.position
    assert approach(lab, mode, side, ONTO_BODY[part]) == 0
    assert np.abs(lab.velocity).max() < 0.05
    state = lab.last("limb/%s/collision_avoidance_state" % side)
    assert part in state.collision_object and not state.other_arm
    assert not reported(lab, side)
    stopped = lab.position
    lab.command(POSITION, start)
    lab.run(1.0)
    own = slice(0, 7) if side == "left" else slice(7, 14)
    assert np.abs(lab.position - stopped)[own].max() > 0.2, "the way back is free"


@pytest.mark.parametrize("part", ONTO_BODY)
def test_suppressed_avoidance_of_the_body_lets_an_arm_touch_it(make_lab, part):
    lab = make_lab(meshes=True, parameters={"enable": True, "effects": "safety"})
    kinds = (collision.BODY_AVOIDANCE, collision.CONTACT, collision.OVERWRENCH)
    assert approach(lab, POSITION, "left", ONTO_BODY[part], kinds) > 100
    assert not lab.last("limb/left/collision_avoidance_state").collision_object


def test_arms_move_freely_between_named_postures(make_lab):
    """In the first one the elbows are beside the mounts: the way out is slow, and free."""
    lab = make_lab(pose="start", parameters={"enable": True, "effects": "safety"})
    for pose in ("neutral", "untucked", "zero", "neutral"):
        goal = np.array([poses().angles(pose, name.split("_")[0])[name] for name in NAMES])
        lab.command(POSITION, goal)
        lab.run(2.5)
        assert np.abs(lab.position - goal).max() < 0.01, pose
        for side in SIDES:
            assert not lab.last("limb/%s/collision_avoidance_state" % side).collision_object, pose


def test_blocks_hold_the_body_s_mesh(robot):
    """All of it but the neck, which is within the guards of the head, and the feet."""
    blocks, finder = blocks_of(effects.read(effects.physical_robot())["body"]), ResourceFinder()
    for link in ("torso", "pedestal"):  # whose frames are that of `base`
        shape, = robot.links[link].collisions
        scene = load_scene(finder(shape.geometry.filename))
        points = np.vstack([np.asarray(mesh.vertices) for mesh in scene.geometry.values()])
        x, y, z = points.T
        feet = (z < -0.64) & ((x < -0.289) | (x > 0.243) | (np.abs(y) > 0.264))
        points = points[(z < 0.54) & ~feet]
        least, most = blocks.corners[:, 0], blocks.corners[:, 1]
        outside = np.maximum(np.maximum(least - points[:, None], points[:, None] - most), 0.0)
        assert np.linalg.norm(outside, axis=2).min(axis=1).max() < 0.015, link


def test_distance_and_closing_speed_to_the_body_are_those_of_the_geometry(make_lab):
    """Against samples of the arm, and finite differences."""
    chain = make_lab().plugin._arms._chains["left"]
    blocks = blocks_of(effects.read(effects.physical_robot())["body"])
    random, checked, step = np.random.default_rng(6), 0, 1e-5
    for _ in range(100):
        q = np.clip(random.normal(0.0, 0.8, 7), chain.lower, chain.upper)
        rates, frames = random.normal(0.0, 0.5, 7), chain.joint_frames(q)
        left, _ = avoidance.around(blocks, frames, rates, 0.0, 1.0)
        for block, first in enumerate(blocks.first):
            points = np.vstack([a + np.linspace(0.0, 1.0, 60)[:, None] * (b - a) for a, b in zip(
                frames[1][first:], frames[1][first + 1:], strict=False)])
            away = points - np.clip(points, *blocks.corners[block])
            assert left[block] == pytest.approx(np.linalg.norm(away, axis=1).min(), abs=0.01)
        moved, _ = avoidance.around(blocks, chain.joint_frames(q + step * rates), rates, 0.0, 1.0)
        closing = (left.min() - moved.min()) / step
        _, share = avoidance.around(blocks, frames, rates, left.min() - 0.01, 1.0)
        if closing > 0.05 and left.min() > 0.02:
            assert share <= 0.01 / closing * 1.05
            checked += 1
    assert checked > 20


@pytest.mark.parametrize("row, said", [({"x_least": 0.0}, "has no 'y_least'"), (
    dict.fromkeys(("x_least", "y_least", "z_least", "x_most", "y_most", "z_most", "first_joint"), 1.0), "not greater")])
def test_blocks_that_are_none_are_refused(row, said):
    with pytest.raises(BaxterHardwareError, match=said):
        blocks_of({"torso_back": row})


def test_a_squeezed_cuff_lets_the_arm_float_and_pushing_it_is_no_collision(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "lag,safety"}, angles=BENT)
    lab.run(0.3)
    assert lab.services["sim/press"](PressRequest("left_lower_cuff", PressRequest.PRESS, 0)).success
    lab.run(0.1)
    start = lab.position
    lab.run(0.5)
    assert np.abs(lab.position - start)[:7].max() < 0.02, "it stays where it is let go"
    link = "left_gripper"
    lab.run(0.6, before=lambda lab: lab.model.apply_wrench(
        link, (0.0, 10.0, 0.0), position=lab.model.link_pose(link).position))
    assert np.abs(lab.position - start)[:7].max() > 0.1
    assert not lab.plugin._baxter.halted("left")


def test_distance_and_closing_speed_between_arms_are_those_of_the_geometry(make_lab):
    """Against finite differences: a step along the rates changes the distance as the slowing supposes."""
    chains = make_lab().plugin._arms._chains
    random = np.random.default_rng(5)
    checked = 0
    for _ in range(60):
        q = {side: np.clip(random.normal(0.0, 0.8, 7), chains[side].lower, chains[side].upper) for side in SIDES}
        rates = random.normal(0.0, 0.5, 7)
        frames = {side: chains[side].joint_frames(q[side]) for side in SIDES}
        left, _ = avoidance.between(frames["left"], frames["right"], rates, 0.0, 1.0)
        points = {side: np.vstack([a + np.linspace(0.0, 1.0, 60)[:, None] * (b - a) for a, b in zip(
            origins[avoidance.FIRST_JOINT:], origins[avoidance.FIRST_JOINT + 1:], strict=False)])
            for side, (_, origins) in frames.items()}
        sampled = np.linalg.norm(points["left"][:, None] - points["right"][None], axis=2).min()
        assert left.min() == pytest.approx(sampled, abs=0.01) and left.min() <= sampled + 1e-9
        step = 1e-5
        ahead = chains["left"].joint_frames(q["left"] + step * rates)
        moved, _ = avoidance.between(ahead, frames["right"], rates, 0.0, 1.0)
        closing = (left.min() - moved.min()) / step
        # At so great a distance nothing is slowed; the share for a smaller one tells the speed.
        apart = left.min() - 0.01
        _, share = avoidance.between(frames["left"], frames["right"], rates, apart, 1.0)
        if closing > 0.02 and share < 1.0:
            assert share <= 0.01 / closing * 1.02
            checked += 1
    assert checked > 10
