# SPDX-License-Identifier: BSD-3-Clause
"""PlanningSceneInterface: what it sends, and what it makes of the scene."""
from types import SimpleNamespace

import pytest
from moveit_msgs.msg import (
    AllowedCollisionEntry,
    AllowedCollisionMatrix,
    AttachedCollisionObject,
    CollisionObject,
    PlanningScene,
    PlanningSceneComponents,
)
from moveit_msgs.srv import ApplyPlanningSceneRequest
from shape_msgs.msg import SolidPrimitive

from moveit_commander import MoveItCommanderException, PlanningSceneInterface, conversions


def at(*xyz):
    return conversions.list_to_pose_stamped([*xyz, 0.0, 0.0, 0.0], "base")


@pytest.fixture
def scene(connection):
    connection.answers["apply_planning_scene"] = SimpleNamespace(success=True)
    return PlanningSceneInterface()


def changed(connection):
    message = connection.called[-1][1]["scene"]
    assert message.is_diff and message.robot_state.is_diff
    return message


@pytest.mark.parametrize(("method", "arguments", "kind", "dimensions"), [
    ("add_box", ((1, 2, 3),), SolidPrimitive.BOX, [1.0, 2.0, 3.0]), ("add_box", (), SolidPrimitive.BOX, [1.0] * 3),
    ("add_sphere", (0.2,), SolidPrimitive.SPHERE, [0.2]), ("add_sphere", (), SolidPrimitive.SPHERE, [1.0]),
    ("add_cylinder", (0.4, 0.1), SolidPrimitive.CYLINDER, [0.4, 0.1]),
    ("add_cone", (0.4, 0.1), SolidPrimitive.CONE, [0.4, 0.1])])
def test_adding_shapes(scene, connection, method, arguments, kind, dimensions):
    assert getattr(scene, method)("thing", at(0.1, 0.2, 0.3), *arguments) is True
    made, = changed(connection).world.collision_objects
    assert (made.id, made.operation, made.header.frame_id) == ("thing", CollisionObject.ADD, "base")
    assert conversions.pose_to_list(made.pose) == [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]
    primitive, = made.primitives
    assert primitive.type == kind and primitive.dimensions == dimensions
    assert conversions.pose_to_list(made.primitive_poses[0]) == [0.0] * 6 + [1.0]


def test_adding_a_plane_and_an_object(scene, connection):
    scene.add_plane("floor", at(0, 0, 0), normal=(0, 1, 0), offset=0.5)
    made, = changed(connection).world.collision_objects
    assert list(made.planes[0].coef) == [0.0, 1.0, 0.0, 0.5] and len(made.plane_poses) == 1
    scene.add_object(CollisionObject(id="own"))
    assert changed(connection).world.collision_objects[0].id == "own"


def test_adding_a_mesh(scene, connection, tmp_path):
    file = tmp_path / "sheet.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene.add_mesh("sheet", at(0, 0, 1), str(file), size=(2, 3, 1))
    mesh, = changed(connection).world.collision_objects[0].meshes
    assert len(mesh.triangles) == 1
    assert sorted((vertex.x, vertex.y) for vertex in mesh.vertices) == [(0.0, 0.0), (0.0, 3.0), (2.0, 0.0)]
    with pytest.raises(MoveItCommanderException, match="gone.stl"):
        scene.add_mesh("gone", at(0, 0, 1), "gone.stl")


def test_removing(scene, connection):
    scene.remove_world_object("thing")
    made, = changed(connection).world.collision_objects
    assert (made.id, made.operation) == ("thing", CollisionObject.REMOVE)
    scene.remove_world_object()
    assert changed(connection).world.collision_objects[0].id == ""
    scene.remove_attached_object("tool", "thing")
    made, = changed(connection).robot_state.attached_collision_objects
    assert (made.link_name, made.object.id, made.object.operation) == ("tool", "thing", CollisionObject.REMOVE)
    assert scene.clear() is True


@pytest.mark.parametrize(("method", "arguments", "shapes"), [
    ("attach_box", (), 0), ("attach_box", (at(0, 0, 0), (1, 1, 1)), 1), ("attach_sphere", (at(0, 0, 0), 0.1), 1),
    ("attach_cylinder", (at(0, 0, 0), 0.2, 0.1), 1), ("attach_mesh", (), 0)])
def test_attaching(scene, connection, method, arguments, shapes):
    getattr(scene, method)("tool", "thing", *arguments)
    made, = changed(connection).robot_state.attached_collision_objects
    assert (made.link_name, made.object.id, made.touch_links) == ("tool", "thing", ["tool"])
    assert len(made.object.primitives) == shapes and made.object.operation == CollisionObject.ADD
    getattr(scene, method)("tool", "thing", touch_links=["tool", "finger"])
    assert changed(connection).robot_state.attached_collision_objects[0].touch_links == ["tool", "finger"]


def test_attaching_objects(scene, connection):
    for given in ("thing", CollisionObject(id="thing")):
        scene.attach_object(given, "tool")
        made, = changed(connection).robot_state.attached_collision_objects
        assert (made.link_name, made.object.id) == ("tool", "thing")
    scene.attach_object(AttachedCollisionObject(link_name="finger"))
    assert changed(connection).robot_state.attached_collision_objects[0].link_name == "finger"
    with pytest.raises(MoveItCommanderException, match="'thing' needs the name of a link"):
        scene.attach_object("thing")


def test_asking(scene, connection):
    near, far = scene.make_box("near", at(0, 0, 0), (1, 1, 1)), scene.make_sphere("far", at(5, 0, 0), 0.1)
    far.type.key = "ball"
    connection.objects = [near, far]
    assert scene.get_known_object_names() == ["near", "far"]
    assert scene.get_known_object_names(with_type=True) == ["far"]
    assert scene.get_known_object_names_in_roi(-1, -1, -1, 1, 1, 1) == ["near"]
    assert scene.get_known_object_names_in_roi(-9, -1, -1, 9, 1, 1) == ["near", "far"]
    assert scene.get_known_object_names_in_roi(-1, -1, -1, 1, 1, 1, True) == []
    assert scene.get_object_poses(["far", "gone"])["far"].position.x == 5.0
    assert list(scene.get_objects()) == ["near", "far"] and list(scene.get_objects(["near"])) == ["near"]
    connection.held = [AttachedCollisionObject(link_name="tool", object=near)]
    assert scene.get_attached_objects()["near"].link_name == "tool" and scene.get_attached_objects(["far"]) == {}
    assert isinstance(scene.get_planning_scene(PlanningSceneComponents.SCENE_SETTINGS), PlanningScene)


def test_on_topics_when_it_need_not_be_synchronous(connection):
    scene = PlanningSceneInterface(synchronous=False)
    assert scene.add_box("thing", at(0, 0, 0)) is True
    scene.attach_box("tool", "thing")
    scene.apply_planning_scene(PlanningScene())
    assert [name for name, _ in connection.published] == [
        "collision_object", "attached_collision_object", "planning_scene"]
    assert connection.called == []


def test_what_programs_reach_for_below_the_methods(scene, connection):
    scene._pub_co.publish(CollisionObject(id="thing", operation=CollisionObject.MOVE))
    scene._pub_aco.publish(AttachedCollisionObject(link_name="tool"))
    assert [name for name, _ in connection.published] == ["collision_object", "attached_collision_object"]
    assert scene._apply_planning_scene_diff(ApplyPlanningSceneRequest(scene=PlanningScene(is_diff=True))).success
    assert connection.called[-1] == ("apply_planning_scene", {"scene": PlanningScene(is_diff=True)})


def matrix(*names):
    return AllowedCollisionMatrix(entry_names=list(names), entry_values=[
        AllowedCollisionEntry(enabled=(False,) * len(names)) for _ in names])


def cells(of, a, b):
    row, column = of.entry_names.index(a), of.entry_names.index(b)
    return of.entry_values[row].enabled[column], of.entry_values[column].enabled[row]


def test_allowing_one_pair():
    allowed = matrix("base", "tool")
    allowed.set_allowed("thing", "tool")
    assert allowed.entry_names == ["base", "tool", "thing"]
    assert cells(allowed, "thing", "tool") == (True, True) and cells(allowed, "thing", "base") == (False, False)
    allowed.set_allowed(["thing"], ["tool", "base"], False)
    assert cells(allowed, "thing", "tool") == (False, False)
    assert all(len(entry.enabled) == 3 for entry in allowed.entry_values)


def test_allowing_everything():
    allowed = matrix("base", "tool")
    allowed.set_allowed("thing")
    assert cells(allowed, "thing", "base") == cells(allowed, "thing", "tool") == (True, True)
    assert cells(allowed, "base", "tool") == (False, False)
    assert (allowed.default_entry_names, allowed.default_entry_values) == (["thing"], [True])
    allowed.set_default("thing", False)
    assert allowed.default_entry_values == [False]
