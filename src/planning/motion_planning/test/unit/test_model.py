# SPDX-License-Identifier: BSD-3-Clause
"""The robot that is planned for: variables, limits, groups, frames."""
import math
import subprocess
import sys

import numpy as np
import pytest

from arm_kinematics import Chain
from motion_planning.model import MeshReader, MeshUnreadable, ModelError, PlanningModel
from motion_planning.model import meshes as mesh_files
from urdf_model.transforms import axis_rotation, rigid


def test_variables_are_what_can_be_moved_depth_first(mix):
    assert mix.variables == ("turn", "push", "grip")
    assert mix.links == ("base", "eye", "turret", "slide", "finger", "thumb")
    assert mix.frame == mix.root == "base" and mix.virtual_joint is None
    assert mix.continuous.tolist() == [True, False, False]
    assert mix.bounds.tolist() == [[-math.pi, math.pi], [0.1, 0.3], [-1.0, 1.0]]
    assert mix.default_state().q.tolist() == [0.0, 0.2, 0.0]


def test_limits_are_narrowed_and_completed(mix_texts):
    limits = {"joint_limits": {
        "push": {"max_position": 0.25, "min_position": -5, "max_velocity": 0.7, "has_velocity_limits": True},
        "grip": {"has_acceleration_limits": True, "max_acceleration": 3, "min_position": 4, "max_position": 5},
        "turn": {"has_velocity_limits": False, "max_velocity": 9, "max_acceleration": -1, "max_position": 1.0},
        "nose": {"max_velocity": 1.0}}}
    model = PlanningModel.from_xml(*mix_texts, limits)
    assert model.bounds.tolist() == [[-math.pi, math.pi], [0.1, 0.25], [-1.0, 1.0]]
    assert model.velocity.tolist() == [1.0, 0.7, 1.0]  # none said, ours, the URDF's 0 means none
    assert model.acceleration.tolist() == [1.0, 1.0, 3.0]
    said = " ".join(model.warnings)
    assert all(word in said for word in ("'nose'", "leave nothing", "is continuous", "acceleration of joint 'turn'"))
    assert model.groups["arm"].chain.upper.tolist() == [math.inf, 0.25]


def test_frames_follow_the_joints_and_those_that_mimic_them(mix):
    base = rigid(axis_rotation((0.0, 0.0, 1.0), 0.3), (1.0, 2.0, 3.0))
    q = np.array([0.7, 0.2, -0.4])
    frames = dict(zip(mix.links, mix.frames(q, base), strict=True))
    joint = mix.robot.joints["turn"]
    turret = base @ joint.origin @ rigid(axis_rotation(joint.axis, 0.7), (0, 0, 0))
    slide = turret @ rigid(np.eye(3), (0.2, 0, 0))
    thumb = slide @ rigid(axis_rotation((0, 0, 1), -2.0 * -0.4 + 0.25), (0, -0.1, 0))
    for link, expected in (("base", base), ("turret", turret), ("slide", slide), ("thumb", thumb),
                           ("eye", base @ rigid(np.eye(3), (0, 0, 1)))):
        np.testing.assert_allclose(frames[link], expected, atol=1e-12)
    np.testing.assert_allclose(mix.frame_of(q, "thumb", base), thumb, atol=1e-12)
    with pytest.raises(ModelError, match="no link 'nose'"):
        mix.frame_of(q, "nose")
    with pytest.raises(ModelError, match="expected 3 joint values"):
        mix.frames(q[:2])


def test_joints_that_mimic_others_have_values(mix):
    assert mix.mimics == {"oppose": ("grip", -2.0, 0.25)}
    assert mix.joint_values([0.7, 0.2, 0.5]) == {"turn": 0.7, "push": 0.2, "grip": 0.5, "oppose": -0.75}


def test_groups(mix):
    arm, hand = mix.groups["arm"], mix.groups["hand"]
    assert (arm.joints, arm.base, arm.tip, arm.links) == (("turn", "push"), "base", "slide", ("turret", "slide"))
    assert arm.indices.tolist() == [0, 1] and arm.moving_links == ("turret", "slide", "finger", "thumb")
    assert isinstance(arm.chain, Chain) and arm.chain.joint_names == arm.joints
    assert arm.states == {"out": {"push": 0.3}} and "'grip'" in mix.warnings[-1]
    assert arm.valued_joints == arm.joints
    assert hand.valued_joints == ("grip", "oppose") and hand.joints == ("grip",)
    assert hand.states == {"fist": {"grip": 1.0}} and not any("'oppose'" in text for text in mix.warnings)
    assert (hand.joints, hand.all_joints) == (("grip",), ("grip", "oppose"))
    assert (hand.base, hand.tip, hand.chain) == (None, None, None) and hand.moving_links == ("finger", "thumb")
    # Joints come in the robot's order, and a list of joints is as good as a chain.
    assert (mix.groups["listed"].joints, mix.groups["listed"].tip) == (("turn", "push"), "slide")
    assert mix.groups["ends"].chain is None
    with pytest.raises(ModelError, match="no group 'leg'; its groups are arm, hand"):
        mix.group("leg")


def test_which_links_are_checked(mix):
    assert not mix.default_collision("base", "turret") and not mix.default_collision("turret", "base")
    assert mix.default_collision("base", "slide")
    assert not mix.default_collision("eye", "slide") and mix.default_collision("eye", "finger")
    assert mix.disabled == frozenset({("base", "turret")})


def test_states_never_change(mix):
    state = mix.default_state()
    other = state.with_joints({"grip": 0.5}).with_base(rigid(np.eye(3), (1, 0, 0)))
    assert state.q[2] == 0.0 and other.positions == {"turn": 0.0, "push": 0.2, "grip": 0.5}
    with pytest.raises(ValueError, match="read-only"):
        other.q[0] = 1.0
    with pytest.raises(ModelError, match="'nose' is not a joint variable"):
        state.with_joints({"nose": 1.0})
    with pytest.raises(ModelError, match="is nan"):
        state.with_joints({"grip": math.nan})


def test_limits_that_are_broken_are_named(mix):
    assert mix.beyond_limits([100.0, 0.2, 0.0]) == []
    assert mix.beyond_limits([0.0, 0.31, -2.0]) == [("push", 0.31, 0.1, 0.3), ("grip", -2.0, -1.0, 1.0)]
    assert mix.beyond_limits([0.0, 0.31, 0.0], margin=0.02) == []
    assert [row[0] for row in mix.beyond_limits([math.nan, 0.2, 0.0])] == ["turn"]
    np.testing.assert_allclose(mix.wrapped([math.pi + 0.5, 0.2, 0.0]), [0.5 - math.pi, 0.2, 0.0])


def test_a_joint_that_mimics_itself_is_refused(mix_texts):
    text = mix_texts[0].replace('<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="0"/>',
                        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="0"/>'
                        '<mimic joint="oppose"/>')
    with pytest.raises(ModelError, match="mimics itself"):
        PlanningModel.from_xml(text, mix_texts[1])


def test_a_fixed_virtual_joint_leaves_the_root_the_planning_frame(mix_texts):
    urdf, srdf = mix_texts
    for kind, frame in (("fixed", "base"), ("floating", "hall"), ("planar", "hall")):
        joint = '<virtual_joint name="stand" type="%s" parent_frame="hall" child_link="base"/></robot>' % kind
        assert PlanningModel.from_xml(urdf, srdf.replace("</robot>", joint)).frame == frame


def test_joints_are_in_moveits_order_whatever_order_texts_have(mix_texts):
    """Depth first, those of one link by name, groups like the robot: programs send values in this order."""
    urdf, srdf = mix_texts
    arm = """<link name="%(s)s"/><link name="%(s)s_tip"/>
      <joint name="%(s)s_arm" type="revolute"><parent link="base"/><child link="%(s)s"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <joint name="a_%(s)s" type="revolute"><parent link="%(s)s"/><child link="%(s)s_tip"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
    model = PlanningModel.from_xml(
        "<robot name='two'><link name='base'/>%s%s</robot>" % (arm % {"s": "right"}, arm % {"s": "left"}),
        "<robot name='two'><group name='both'><group name='r'/><group name='l'/></group>"
        "<group name='r'><joint name='a_right'/><joint name='right_arm'/></group>"
        "<group name='l'><link name='left_tip'/><link name='left'/></group></robot>")
    assert model.variables == model.groups["both"].joints == ("left_arm", "a_left", "right_arm", "a_right")
    assert model.groups["r"].joints == ("right_arm", "a_right")


def test_texts_that_are_none_are_refused(mix_texts):
    urdf, srdf = mix_texts
    with pytest.raises(ModelError, match="not a URDF"):
        PlanningModel.from_xml("<sdf/>", srdf)
    with pytest.raises(ModelError, match="not an SRDF"):
        PlanningModel.from_xml(urdf, "<sdf/>")
    assert PlanningModel.from_xml(urdf, "").groups == {}


def test_baxters_groups(baxter):
    assert baxter.frame == "world" and baxter.virtual_joint.type == "floating"
    names = ["s0", "s1", "e0", "e1", "w0", "w1", "w2"]
    for side in ("left", "right"):
        arm = baxter.groups[side + "_arm"]
        assert arm.joints == tuple("%s_%s" % (side, name) for name in names) and arm.tip == side + "_gripper"
    both = baxter.groups["both_arms"]
    assert both.joints == baxter.groups["left_arm"].joints + baxter.groups["right_arm"].joints
    assert both.chain is None and both.subgroups == ("right_arm", "left_arm")
    hand = baxter.groups["left_hand"]
    assert hand.joints == () and hand.tip == "left_gripper" and hand.end_effector.name == "left_hand_eef"
    assert baxter.groups["left_arm"].end_effectors == ("left_hand_eef",)
    assert baxter.groups["left_arm"].states["left_neutral"]["left_w1"] == 1.26


def test_frames_are_those_of_the_kinematics(baxter):
    generator = np.random.default_rng(3)
    for name in ("left_arm", "right_arm"):
        arm = baxter.groups[name]
        q = generator.uniform(*baxter.bounds.T)
        frames = baxter.frames(q)
        mount = frames[baxter.link_index[arm.base]]
        for link, pose in arm.chain.link_frames(q[arm.indices]).items():
            np.testing.assert_allclose(frames[baxter.link_index[link]], mount @ pose, atol=1e-12)


def test_probots_group(probot):
    group = probot.groups["manipulator"]
    assert group.joints == tuple("joint_%d" % number for number in range(1, 7))
    assert (group.base, group.tip) == ("base_link", "tool0") and "home" in group.states and probot.frame == probot.root


def test_meshes_are_read_as_they_are(baxter, meshes):
    filename = next(shape.geometry.filename for shape in baxter.robot.links["torso"].collisions)
    mesh = meshes(filename)
    assert len(mesh.triangles) > 100 and meshes(filename) is mesh
    assert 0.2 < np.ptp(mesh.vertices, axis=0).max() < 2.0


def full_disk(*_):
    raise OSError(28, "No space left on device")


def test_triangles_are_kept_until_the_file_changes(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    path = tmp_path / "one.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    first = MeshReader(lambda name: path)("one")
    made = []
    monkeypatch.setattr(mesh_files, "_made", lambda path, make=mesh_files._made: made.append(path) or make(path))
    again = MeshReader(lambda name: path)("one")
    assert not made and np.array_equal(again.vertices, first.vertices) and again.triangles.shape == (1, 3)
    kept, = (tmp_path / "kept").glob("*/*.npz")
    kept.write_bytes(b"half a file")
    assert MeshReader(lambda name: path)("one").vertices.max() == 1.0 and len(made) == 1
    path.write_text("v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n")
    assert MeshReader(lambda name: path)("one").vertices.max() == 2.0 and len(made) == 2
    monkeypatch.setattr(mesh_files.os, "replace", full_disk)
    path.write_text("v 0 0 0\nv 3 0 0\nv 0 3 0\nf 1 2 3\n")
    assert MeshReader(lambda name: path)("one").vertices.max() == 3.0  # read, though not kept
    assert len(list((tmp_path / "kept").glob("motion_planning_meshes-*/*"))) == 2
    path.write_text("f 1 2 3\n")
    for _ in range(2):
        with pytest.raises(MeshUnreadable, match="mesh one cannot be used"):
            MeshReader(lambda name: path)("one")


def test_planning_loads_no_simulator_and_no_library_for_files():
    text = "import sys, motion_planning.pipeline, motion_planning.planners; " \
           "print(sorted({'pybullet', 'trimesh', 'bullet_sim', 'ompl', 'cv2'} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.strip() == "[]"
