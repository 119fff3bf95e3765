# SPDX-License-Identifier: BSD-3-Clause
"""Messages to scenes and back."""
import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, TransformStamped, Vector3
from moveit_msgs.msg import (
    AllowedCollisionEntry,
    AttachedCollisionObject,
    CollisionObject,
    LinkPadding,
    ObjectColor,
    PlanningScene,
    PlanningSceneComponents,
    RobotState,
)
from octomap_msgs.msg import Octomap
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive
from std_msgs.msg import ColorRGBA

from motion_planning.errors import PlanningError
from motion_planning.scene import WorldObject
from motion_planning.timing import time_path
from moveit_ros_move_group.convert.geometry import MessageError, matrix_of, plane_shape_of, pose_of, shape_of
from moveit_ros_move_group.convert.octomap import octree_of
from moveit_ros_move_group.convert.scene_in import SceneReader
from moveit_ros_move_group.convert.scene_out import scene_diff, scene_message, state_message, trajectory_message
from urdf_model import Box
from urdf_model.transforms import axis_rotation, rigid

READER = SceneReader()
UNIT = Quaternion(0.0, 0.0, 0.0, 1.0)


def box(name="box", frame="world", position=(1.0, 0.0, 0.0), operation=CollisionObject.ADD):
    message = CollisionObject(id=name, operation=operation, pose=Pose(Point(*position), UNIT))
    message.header.frame_id = frame
    if operation in (CollisionObject.ADD, CollisionObject.APPEND):
        message.primitives = [SolidPrimitive(SolidPrimitive.BOX, [0.1, 0.2, 0.3])]
        message.primitive_poses = [Pose(Point(0.0, 0.0, 0.5), UNIT)]
    return message


def attached(name="box", link="hand", operation=CollisionObject.ADD, **options):
    message = AttachedCollisionObject(link_name=link, **options)
    message.object.id, message.object.operation = name, operation
    return message


# -- geometry ------------------------------------------------------------------------------------------------------


def test_poses_there_and_back():
    matrix = rigid(axis_rotation(np.array([0.6, 0.0, 0.8]), 2.0), (1.0, -2.0, 3.0))
    assert np.allclose(matrix_of(pose_of(matrix)), matrix)
    assert np.allclose(matrix_of(Transform(Vector3(1.0, 2.0, 3.0), UNIT))[:3, 3], (1.0, 2.0, 3.0))


def test_zero_quaternion_is_the_identity_and_others_are_refused():
    assert np.allclose(matrix_of(Pose(Point(1.0, 0.0, 0.0), Quaternion())), rigid(np.eye(3), (1.0, 0.0, 0.0)))
    with pytest.raises(MessageError, match="length 2"):
        matrix_of(Pose(Point(), Quaternion(0.0, 0.0, 0.0, 2.0)))
    with pytest.raises(MessageError, match="not finite"):
        matrix_of(Pose(Point(float("nan"), 0.0, 0.0), UNIT))


@pytest.mark.parametrize("kind, sizes", [(SolidPrimitive.BOX, [1.0, 2.0]), (SolidPrimitive.SPHERE, [0.0]),
                                         (SolidPrimitive.CYLINDER, [1.0, float("nan")]), (9, [1.0])])
def test_bad_primitives_are_refused(kind, sizes):
    with pytest.raises(MessageError):
        shape_of(SolidPrimitive(kind, sizes))


def test_cylinders_and_cones_have_height_first():
    cylinder, cone = (shape_of(SolidPrimitive(kind, [2.0, 0.3])) for kind in (3, 4))
    assert (cylinder.length, cylinder.radius, cone.length, cone.radius) == (2.0, 0.3, 2.0, 0.3)


def test_planes_stand_where_their_equation_is_met():
    """a x + b y + c z + d = 0 at the plane's origin, its z axis along the normal."""
    _, pose = plane_shape_of(Plane((0.0, 3.0, 4.0, -10.0)))
    assert np.isclose(np.array([0.0, 3.0, 4.0]) @ pose[:3, 3], 10.0)
    assert np.allclose(pose[:3, 2], (0.0, 0.6, 0.8)) and np.isclose(np.linalg.det(pose[:3, :3]), 1.0)
    with pytest.raises(MessageError):
        plane_shape_of(Plane((0.0, 0.0, 0.0, 1.0)))


# -- objects -------------------------------------------------------------------------------------------------------


def test_objects_are_added_moved_appended_and_removed(scene):
    scene = READER.with_collision_object(scene, box())
    assert np.allclose(scene.objects["box"].pose[:3, 3], (1.0, 0.0, 0.0))
    assert np.allclose(scene.objects["box"].shapes[0][1][:3, 3], (0.0, 0.0, 0.5))
    moved = READER.with_collision_object(scene, box(position=(2.0, 0.0, 0.0), operation=CollisionObject.MOVE))
    assert np.allclose(moved.objects["box"].pose[:3, 3], (2.0, 0.0, 0.0)) and len(moved.objects["box"].shapes) == 1
    more = READER.with_collision_object(moved, box(operation=CollisionObject.APPEND))
    assert len(more.objects["box"].shapes) == 2
    assert not READER.with_collision_object(more, box(operation=CollisionObject.REMOVE)).objects
    assert not READER.with_collision_object(more, box("", operation=CollisionObject.REMOVE)).objects


def test_one_shape_without_an_object_pose_gives_the_object_its_pose(scene):
    message = box()
    message.pose = Pose()
    one = READER.with_collision_object(scene, message).objects["box"]
    assert np.allclose(one.pose[:3, 3], (0.0, 0.0, 0.5)) and np.allclose(one.shapes[0][1], np.eye(4))


def test_poses_are_seen_from_links_and_objects(scene):
    scene = READER.with_collision_object(scene, box("there", "hand", (0.1, 0.0, 0.0)))
    assert np.allclose(scene.objects["there"].pose, scene.frame("hand") @ rigid(np.eye(3), (0.1, 0.0, 0.0)))
    upon = READER.with_collision_object(scene, box("upon", "there", (0.0, 0.0, 1.0)))
    assert np.allclose(upon.objects["upon"].pose[:3, 3], scene.objects["there"].pose[:3, 3] + (0.0, 0.0, 1.0))


@pytest.mark.parametrize("message, sentence", [
    (box("box", "nowhere"), "ADD of collision object 'box' refused: 'nowhere' is not a frame"),
    (box("none", operation=CollisionObject.REMOVE), "REMOVE of collision object 'none' refused"),
    (box("none", operation=CollisionObject.MOVE), "MOVE of collision object 'none' refused"),
    (box("<octomap>"), "octomap's name"),
    (CollisionObject(id="bare"), "no shapes"),
])
def test_what_cannot_be_done_is_told(scene, message, sentence):
    with pytest.raises(PlanningError) as refused:
        READER.with_collision_object(scene, message)
    assert sentence in str(refused.value)


def test_meshes_without_triangles_are_refused(scene):
    message = CollisionObject(id="mesh", meshes=[Mesh([], [Point()])], mesh_poses=[Pose()])
    with pytest.raises(PlanningError, match="no triangles"):
        READER.with_collision_object(scene, message)


def test_objects_are_taken_and_put_back(scene):
    scene = READER.with_collision_object(scene, box())
    held = READER.with_attached_object(scene, attached(touch_links=["arm"]))
    assert not held.objects and held.state.attached["box"].touch_links == {"arm", "hand"}
    assert np.allclose(held.frame("box"), scene.frame("box"))
    back = READER.with_attached_object(held, attached(operation=CollisionObject.REMOVE))
    assert np.allclose(back.objects["box"].pose, scene.objects["box"].pose) and not back.state.attached


def test_attached_geometry_is_seen_from_its_frame_or_from_the_link(scene):
    message = attached()
    message.object = box("tool", "", (0.2, 0.0, 0.0))
    held = READER.with_attached_object(scene, message)
    assert np.allclose(held.state.attached["tool"].object.pose[:3, 3], (0.2, 0.0, 0.0))
    message.object.header.frame_id = "world"
    held = READER.with_attached_object(scene, message)
    assert np.allclose(held.frame("tool")[:3, 3], (0.2, 0.0, 0.0))


def test_attaching_to_nothing_is_told(scene):
    with pytest.raises(PlanningError, match="no such link"):
        READER.with_attached_object(scene, attached(link="nose"))


# -- scenes --------------------------------------------------------------------------------------------------------


def full(scene):
    """A scene with one of everything."""
    scene = READER.with_collision_object(scene, box())
    message = box("mixed", "base")
    corners = [Point(0.0, 0.0, 0.0), Point(1.0, 0.0, 0.0), Point(0.0, 1.0, 0.0)]
    message.meshes = [Mesh([MeshTriangle((0, 1, 2))], corners)]
    message.mesh_poses, message.planes = [Pose(orientation=UNIT)], [Plane((0.0, 0.0, 1.0, -2.0))]
    message.plane_poses = [Pose(orientation=UNIT)]
    message.subframe_names, message.subframe_poses = ["handle"], [Pose(Point(0.0, 0.0, 0.1), UNIT)]
    scene = READER.with_collision_object(scene, message)
    held = attached(touch_links=["arm"])
    held.object = box("tool", "hand")
    scene = READER.with_attached_object(scene, held)
    return scene.with_colours({"box": (1.0, 0.0, 0.0, 1.0)}).with_padding({"arm": 0.01}).with_allowed(
        scene.allowed.with_entries({("box", "arm"): True}))


def assert_same(a, b):
    assert list(a.objects) == list(b.objects) and set(a.state.attached) == set(b.state.attached)
    for name, one in a.objects.items():
        assert np.allclose(one.pose, b.objects[name].pose)
        assert [type(shape) for shape, _ in one.shapes] == [type(shape) for shape, _ in b.objects[name].shapes]
        for (_, pose), (_, other) in zip(one.shapes, b.objects[name].shapes, strict=True):
            assert np.allclose(pose, other)
        assert set(one.subframes) == set(b.objects[name].subframes)
    for name, body in a.state.attached.items():
        other = b.state.attached[name]
        assert (body.link, body.touch_links) == (other.link, other.touch_links)
        assert np.allclose(body.object.pose, other.object.pose)
    assert np.allclose(a.state.q, b.state.q) and np.allclose(a.state.base, b.state.base)
    assert a.allowed.allowed("box", "arm") == b.allowed.allowed("box", "arm")
    assert dict(a.colours) == dict(b.colours) and a.link_padding.get("arm", 0.0) == b.link_padding.get("arm", 0.0)


def test_a_whole_scene_goes_there_and_back(scene):
    there = full(scene).with_state(full(scene).state.with_base(rigid(np.eye(3), (0.0, 1.0, 0.0))))
    message = scene_message(there)
    assert not message.is_diff and message.robot_model_name == "crane"
    back, errors = READER.with_planning_scene(scene, message)
    assert not errors
    assert_same(there, back)


def test_a_diff_leads_from_one_scene_to_the_other(scene):
    before = full(scene)
    after = READER.with_collision_object(before, box("new"))
    after = READER.with_collision_object(after, box("mixed", operation=CollisionObject.REMOVE))
    after = READER.with_attached_object(after, attached("tool", operation=CollisionObject.REMOVE))
    after = after.with_state(after.state.with_joints({"turn": -1.0})).with_colours({"new": (0.0, 1.0, 0.0, 1.0)})
    message = scene_diff(before, after)
    assert message.is_diff and message.robot_state.is_diff
    back, errors = READER.with_planning_scene(before, message)
    assert not errors
    assert set(back.objects) == set(after.objects) and not back.state.attached
    assert np.allclose(back.state.q, after.state.q) and dict(back.colours) == dict(after.colours)


def test_nothing_changed_is_an_empty_diff(scene):
    before = full(scene)
    message = scene_diff(before, before)
    assert not (message.world.collision_objects or message.robot_state.joint_state.name or message.object_colors
                or message.allowed_collision_matrix.entry_names)


def test_components_choose_parts(scene):
    there, wants = full(scene), PlanningSceneComponents
    names = scene_message(there, wants.WORLD_OBJECT_NAMES)
    assert [one.id for one in names.world.collision_objects] == ["box", "mixed"]
    assert not names.world.collision_objects[0].primitives and not names.robot_state.joint_state.name
    state = scene_message(there, wants.ROBOT_STATE)
    assert state.robot_state.joint_state.name == ["turn", "reach", "balance"]
    assert not state.robot_state.attached_collision_objects and not state.world.collision_objects
    assert scene_message(there, wants.ROBOT_STATE_ATTACHED_OBJECTS).robot_state.attached_collision_objects


def test_a_diff_without_entries_leaves_the_allowed_collisions_as_they_are(scene):
    """As in MoveIt, which replaces the matrix by one with entry_names only; an empty one means nothing."""
    scene = scene.with_allowed(scene.allowed.with_entries({("arm", "base"): True}))
    message = PlanningScene(is_diff=True)
    message.allowed_collision_matrix.default_entry_names = ["crate"]
    message.allowed_collision_matrix.default_entry_values = [True]
    changed, errors = READER.with_planning_scene(scene, message)
    assert not errors and changed.allowed is scene.allowed
    message.allowed_collision_matrix.entry_names = ["crate"]
    message.allowed_collision_matrix.entry_values = [AllowedCollisionEntry([False])]
    changed, errors = READER.with_planning_scene(scene, message)
    assert not errors and changed.allowed.allowed("crate", "hand") and not changed.allowed.allowed("arm", "base")
    message.allowed_collision_matrix.entry_names, message.allowed_collision_matrix.entry_values = [], []
    message.is_diff = False
    assert READER.with_planning_scene(scene, message)[0].allowed.allowed("crate", "hand")


def test_an_empty_field_of_a_diff_changes_nothing_and_others_are_added(scene):
    full = scene.with_transforms({"wall": rigid(np.eye(3), (1.0, 0.0, 0.0))}).with_padding({"arm": 0.1}, {"arm": 2.0})
    full = full.with_colours({"crate": (1.0, 0.0, 0.0, 1.0)}).with_object(
        WorldObject("crate", np.eye(4), ((Box((0.1, 0.1, 0.1)), np.eye(4)),)))
    full = READER.with_planning_scene(full, PlanningScene(is_diff=True, name="kitchen"))[0]
    message = PlanningScene(is_diff=True)
    same, errors = READER.with_planning_scene(full, message)
    assert not errors and same.name == "kitchen"
    for name in ("state", "objects", "allowed", "colours", "octomap", "transforms", "link_padding", "link_scale"):
        assert getattr(same, name) is getattr(full, name) or dict(getattr(same, name)) == dict(getattr(full, name))
    tree = TransformStamped(child_frame_id=scene.model.frame, transform=Transform(Vector3(0.0, 2.0, 0.0), UNIT))
    tree.header.frame_id = "door"  # MoveIt's way round: the child is the planning frame
    message.fixed_frame_transforms, message.link_padding = [tree], [LinkPadding("hand", 0.2)]
    more, errors = READER.with_planning_scene(full, message)
    assert not errors and set(more.transforms) == {"wall", "door"} and more.link_padding == {"arm": 0.1, "hand": 0.2}
    assert np.allclose(more.frame("door")[:3, 3], (0.0, 2.0, 0.0))


def test_a_diff_that_fails_in_part_does_the_rest(scene):
    message = PlanningScene(is_diff=True)
    message.robot_state.is_diff = True
    message.world.collision_objects = [box("bad", "nowhere"), box("good")]
    message.link_padding = [LinkPadding("nose", 0.1)]
    message.object_colors = [ObjectColor("good", ColorRGBA(1.0, 1.0, 1.0, 1.0))]
    after, errors = READER.with_planning_scene(scene, message)
    assert set(after.objects) == {"good"} and "good" in after.colours
    assert len(errors) == 2 and any("'bad'" in error for error in errors) and any("'nose'" in error for error in errors)


def test_attach_and_remove_in_one_diff(scene):
    """As MoveIt's tutorials do it."""
    scene = READER.with_collision_object(scene, box())
    message = PlanningScene(is_diff=True)
    message.robot_state.is_diff = True
    held = attached()
    held.object = box(frame="world")
    message.robot_state.attached_collision_objects = [held]
    message.world.collision_objects = [box(operation=CollisionObject.REMOVE)]
    after, errors = READER.with_planning_scene(scene, message)
    assert not errors and not after.objects and set(after.state.attached) == {"box"}


def test_states_are_laid_over(scene):
    errors = []
    message = RobotState(is_diff=True)
    message.joint_state.name, message.joint_state.position = ["reach", "unknown"], [0.7, 3.0]
    after = READER.with_robot_state(full(scene), message, errors)
    assert after.state.positions == {"turn": 0.5, "reach": 0.7} and after.state.attached and not errors
    message.is_diff = False
    assert not READER.with_robot_state(full(scene), message, errors).state.attached
    message.joint_state.position = [0.7]
    READER.with_robot_state(scene, message, errors)
    assert "2 joint names but 1 position" in errors[0]
    message.joint_state.position = [float("inf"), 0.0]
    READER.with_robot_state(scene, message, errors)
    assert "joint 'reach' is not finite" in errors[1]


def test_a_state_has_the_joints_that_mimic_others(scene):
    joints = state_message(scene.model, scene.state).joint_state
    assert dict(zip(joints.name, joints.position, strict=True)) == pytest.approx(
        {"turn": 0.5, "reach": 0.2, "balance": -0.2})


def test_states_there_and_back(scene):
    there = scene.with_state(scene.state.with_base(rigid(axis_rotation((0.0, 0.0, 1.0), 1.0), (1.0, 2.0, 0.0))))
    errors = []
    back = READER.with_robot_state(scene, state_message(scene.model, there.state), errors)
    assert np.allclose(back.state.base, there.state.base) and np.allclose(back.state.q, there.state.q) and not errors


def test_trajectories_have_every_field():
    timed = time_path([[0.0, 0.0], [1.0, 0.5]], [1.0, 1.0], [1.0, 1.0])
    message = trajectory_message(["turn", "reach"], timed, "world")
    points = message.joint_trajectory.points
    assert len(points) == len(timed.times) and message.joint_trajectory.joint_names == ["turn", "reach"]
    assert points[-1].time_from_start.to_sec() == pytest.approx(timed.duration)
    assert all(len(point.positions) == len(point.velocities) == len(point.accelerations) == 2 for point in points)


# -- octomap -------------------------------------------------------------------------------------------------------


def tree(*path_of_kinds):
    """Data of a binary tree along one path: (child, kind) a level; the last one is not an inner node."""
    return b"".join((kind << 2 * child).to_bytes(2, "little") for child, kind in path_of_kinds)


def octomap(data, **options):
    return Octomap(binary=True, id="OcTree", resolution=0.1, data=list(np.frombuffer(data, dtype=np.int8)), **options)


def test_binary_octomaps_are_read():
    """Sixteen levels, each time the child at +x +y +z: the smallest cube in the corner of the map."""
    inner = [(7, 3)] * 15
    octree = octree_of(octomap(tree(*inner, (7, 2))))
    corner = 0.1 * 2**15
    assert np.allclose(octree.boxes, [[corner - 0.05] * 3 + [0.1]])
    assert octree_of(octomap(tree(*inner, (7, 1)))) is None
    big = octree_of(octomap(tree((0, 2))))
    assert np.allclose(big.boxes, [[-0.5 * corner] * 3 + [corner]])


def test_full_octomaps_are_read():
    data = np.float32(1.0).tobytes() + bytes([0b10]) + np.float32(0.4).tobytes() + bytes([0])
    message = octomap(data)
    message.binary = False
    octree = octree_of(message)
    half = 0.1 * 2**15
    assert np.allclose(octree.boxes, [[0.5 * half, -0.5 * half, -0.5 * half, half]])


def test_broken_octomaps_are_refused():
    with pytest.raises(MessageError, match="end too early"):
        octree_of(octomap(tree((7, 3))))
    with pytest.raises(MessageError, match="expected an OcTree"):
        octree_of(Octomap(binary=True, id="Voxels", resolution=0.1, data=[0, 0]))
