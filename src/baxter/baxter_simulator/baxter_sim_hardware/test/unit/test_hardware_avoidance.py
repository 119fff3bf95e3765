# SPDX-License-Identifier: BSD-3-Clause
"""The field around the head: nothing collides with it; it slows and stops approaching arms, unless suppressed."""
import numpy as np
import pytest
from std_msgs.msg import Empty

from arm_kinematics import Chain, OwnBody
from baxter_model import JOINTS, SIDES, poses, tip_of
from baxter_model.description import arm_radius, avoided_balls, head_guards
from baxter_model.self_collision import HEAD, HEAD_GUARDS
from baxter_sim_hardware.arms import avoidance, collision
from baxter_sim_hardware.arms.guarding import guards_of

HEARD = ("state", "limb/*/collision_avoidance_state")

POSITION, VELOCITY = 1, 2
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)
FOLDED, UNFOLDED = ([poses().angles(pose, name.split("_")[0])[name] for name in NAMES]
                    for pose in ("tucked", "untucked"))
PERIOD_TICKS = 25  # tuck_arms commands and suppresses at 20 Hz
FINGERS = ("l_gripper_l_finger_joint", "l_gripper_r_finger_joint", "r_gripper_l_finger_joint",
           "r_gripper_r_finger_joint")


class TouchesNothing:
    @staticmethod
    def contact(joint_names, q):
        return None


def own_contacts(lab):
    return {(contact.link_a, contact.link_b) for contact in lab.world.contacts(lab.model, lab.model)
            if contact.distance <= 0.0 or contact.force > 0.0}


def stream(goal, kinds=()):
    """Function for `before`: command a posture and suppress `kinds`, as tuck_arms does."""
    def send(lab):
        if lab.world.tick % PERIOD_TICKS == 0:
            lab.command(POSITION, goal)
            for kind in kinds:
                for side in SIDES:
                    lab.send("limb/%s/%s" % (side, kind), Empty())

    return send


def listed(lab):
    return {name for side in SIDES for name in lab.last("limb/%s/collision_avoidance_state" % side).collision_object}


def gap(lab, side):
    """[m] from one arm, as thick as it is, to the nearest guard: by points along its capsules."""
    robot = lab.context.robot
    _, origins = Chain.from_robot(robot, tip=tip_of(side)).joint_frames(lab.position[slice(0, 7) if side == "left"
                                                                                     else slice(7, 14)])
    share = np.linspace(0.0, 1.0, 400)[:, None]
    points = np.vstack([a + share * (b - a) for a, b in zip(origins[2:], origins[3:], strict=False)])
    return min(np.linalg.norm(points - centre, axis=1).min() - radius - arm_radius(robot)
               for _, centre, radius in head_guards(robot))


@pytest.mark.parametrize("side", SIDES)
def test_distance_and_closing_speed_are_those_of_the_geometry(robot, side):
    """Against finite differences: a step along the rates changes the gap as the field computes."""
    guards, chain = guards_of(robot), Chain.from_robot(robot, tip=tip_of(side))
    rng, step, checked = np.random.default_rng(5), 1e-6, 0
    for q in rng.uniform(chain.lower, chain.upper, (300, 7)):
        rates = rng.uniform(-1.0, 1.0, 7)
        for k, name in enumerate(guards.names):
            one = avoidance.Guards((name,), guards.centres[k:k + 1], guards.radii[k:k + 1])

            def look(posture, one=one, rates=rates):
                distances, _, slowing = avoidance._distances(
                    one.centres, one.radii, *chain.joint_frames(posture), rates)
                return distances[0], slowing

            distance, slowing = look(q)
            closing = (distance - look(q + step * rates)[0]) / step
            allowed = max(distance, 0.0) / avoidance.CLOSING_S
            if closing > 1.05 * allowed:
                # Another capsule, farther away and faster, may limit the speed more.
                assert slowing <= 1.001 * allowed / closing
                checked += 1
            near = avoidance.field(one, *chain.joint_frames(q), rates).near
            assert near == ((name,) if distance < avoidance.FIELD_M else ())
    assert checked > 10


@pytest.mark.parametrize("side", SIDES)
def test_ik_leaves_out_the_postures_in_which_the_field_holds_an_arm(robot, side):
    """Inverse kinematics knows the field without its speeds."""
    guards, chain = guards_of(robot), Chain.from_robot(robot, tip=tip_of(side))
    body = OwnBody(chain, avoided_balls(robot), avoidance.FIRST_JOINT, TouchesNothing())
    held = 0
    for q in np.random.default_rng(6).uniform(chain.lower, chain.upper, (500, 7)):
        _, nearest, _ = avoidance._distances(guards.centres, guards.radii, *chain.joint_frames(q), np.zeros(7))
        assert body(q) == (nearest >= 0.0)
        held += nearest < 0.0
    assert 20 < held < 400


@pytest.mark.parametrize("kinds", [(), (collision.AVOIDANCE,), (collision.BODY_AVOIDANCE,)])
def test_arms_stop_at_the_field_unless_it_is_suppressed(make_lab, kinds):
    lab = make_lab(pose="untucked", meshes=True, parameters={"enable": True})
    lab.run(0.1)
    assert listed(lab) == set()
    gaps, names, touches = [], set(), set()

    def watch(lab):
        gaps.append(min(gap(lab, side) for side in SIDES))
        names.update(listed(lab))
        touches.update(own_contacts(lab))

    lab.run(4.0, before=stream(FOLDED, kinds), after=lambda lab: lab.world.tick % 10 or watch(lab))
    assert touches == set()
    if kinds:
        assert names == set() and np.abs(lab.position - FOLDED).max() < 0.01
        assert not any("held by" in line for line in lab.log.lines)
        assert min(gaps) < -3e-3  # through the field, which must not block it
        return
    assert names and names <= set(HEAD_GUARDS)
    for side in SIDES:
        said, = (line for line in lab.log.lines if line.startswith("%s limb is held by collision avoidance" % side))
        assert "too near to collision_head_link_" in said
        assert lab.plugin.held[side] and set(lab.plugin.held[side]) <= set(HEAD_GUARDS)
    assert min(gaps) > -2e-3 and np.abs(lab.position - FOLDED).max() > 0.3
    assert np.abs(lab.velocity).max() < 0.02
    # Motion away is free.
    lab.command(POSITION, UNFOLDED)
    lab.run(3.5)
    assert np.abs(lab.position - UNFOLDED).max() < 1e-3 and listed(lab) == set()
    assert not any(lab.plugin.held.values())


def test_velocity_mode_is_slowed_too(make_lab):
    lab = make_lab(pose="untucked", parameters={"enable": True})
    rates = 0.4 * np.sign(np.array(FOLDED) - UNFOLDED) * np.minimum(np.abs(np.array(FOLDED) - UNFOLDED), 1.0)
    gaps = []
    lab.run(3.0, before=lambda lab: lab.command(VELOCITY, rates),
            after=lambda lab: lab.world.tick % 10 or gaps.append(min(gap(lab, side) for side in SIDES)))
    assert -2e-3 < min(gaps) < avoidance.FIELD_M


@pytest.mark.parametrize("start", ["neutral", "tucked"])
def test_arms_fold_and_unfold_as_the_vendors_program_has_them(make_lab, start):
    """By way of the unfolded posture, in position mode, with avoidance suppressed where the arms are flipped.

    A posture is passed when all joints, of the folded one the shoulders', are within 0.2 rad. Nothing touches, and the
    grippers stay open.
    """
    lab = make_lab(pose=start, meshes=True, parameters={"enable": True})
    lab.run(0.2)
    fingers = lab.model.index(FINGERS)
    spread, touches, moved = lab.model.read_joints()[0][fingers], set(), []
    goals = [(UNFOLDED, start == "tucked"), (FOLDED, True), (UNFOLDED, True)]

    def watch(lab):
        touches.update(own_contacts(lab))
        moved.append(np.abs(lab.model.read_joints()[0][fingers] - spread).max())

    for goal, suppressed in goals:
        joints = [i for i in range(14) if goal is UNFOLDED or i % 7 < 2]
        for _ in range(round(8.0 / 0.05)):
            lab.run(0.05, before=stream(goal, (collision.AVOIDANCE,) if suppressed else ()), after=watch)
            if np.abs(lab.position - goal)[joints].max() < 0.2:
                break
        else:
            pytest.fail("the arms did not come to %s within 8 s: %s" % (goal, lab.position))
        assert listed(lab) == set()
    assert touches == set()
    assert max(moved) < 1e-4


def test_the_head_itself_is_solid(make_lab):
    """Random postures: an arm inside the head touches it, and the guards touch nothing."""
    lab = make_lab(meshes=True)
    rng, touched = np.random.default_rng(3), set()
    for q in rng.uniform(lab.model.lower[lab.arm], lab.model.upper[lab.arm], (1500, 14)):
        lab.model.set_joint_positions(lab.arm, q)
        touched.update(link for contact in lab.world.touching(lab.model) for link in (contact.link_a, contact.link_b)
                       if contact.distance < 0.0 and HEAD in (contact.link_a, contact.link_b))
    assert {"left_lower_elbow", "right_lower_elbow"} <= touched
    shapes = {shape.link for link in lab.model.merged.links.values() for shape in link.collisions}
    assert not shapes & set(HEAD_GUARDS)


@pytest.mark.parametrize("profile", ["sim", "robot"])
@pytest.mark.parametrize("at_start", [True, False])
def test_folded_arms_keep_the_robots_profile_disabled(make_lab, profile, at_start):
    """Unless the field is suppressed, as tuck_arms does it."""
    lab = make_lab(pose="tucked", parameters={"enable": at_start, "profile": profile})
    lab.run(0.1)
    assert listed(lab) == {*HEAD_GUARDS, *(("torso",) if profile == "robot" else ())}
    if not at_start:
        lab.enable()
    lab.run(0.1)
    assert lab.last("state").enabled == (profile == "sim")
    if profile == "sim":
        return
    assert any("enable ignored: in the field of collision avoidance: the left arm (collision_head_link_" in line
               and "tuck_arms.py -u" in line for line in lab.log.lines)
    for side in SIDES:
        lab.send("limb/%s/%s" % (side, collision.AVOIDANCE), Empty())
    lab.run(0.1)
    lab.enable()
    lab.run(1.0)
    assert lab.last("state").enabled
    # Elsewhere it can always be enabled.
    lab.run(9.0, before=stream(UNFOLDED, (collision.AVOIDANCE,)))
    lab.enable(False)
    lab.enable()
    lab.run(0.1)
    assert lab.last("state").enabled and listed(lab) == set()
