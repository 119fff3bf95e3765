# SPDX-License-Identifier: BSD-3-Clause
"""Our xacro against the vendor's URDF: frames, axes, limits, masses, inertias, shapes, except one table of
differences."""
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml

from urdf_model import Mesh

TEST = Path(__file__).resolve().parents[1]
SIDES = ("left", "right")
# (relative, absolute): the vendor's file writes angles with 9 to 12 digits, ours come from pi. Masses and inertias are
# the same decimal numbers, some as small as 1e-8 kg m^2.
TOLERANCE = (1e-8, 1e-8)
MASS_TOLERANCE = (1e-9, 1e-15)


def vendor_names():
    """Names of the vendor's file that differ from the robot's own: {("link" or "joint", theirs): ours}."""
    frames = ["head_camera"] + ["%s_%s" % (side, frame) for side in SIDES for frame in (
        "hand", "hand_camera", "hand_camera_axis", "hand_range", "hand_accelerometer", "gripper_base")]
    return {(kind, "%s_%s" % (frame, kind)): frame for frame in frames for kind in ("link", "joint")}


def differences_table():
    """The table with {side} expanded: {(element, property): (ours, vendor)}."""
    rows = yaml.safe_load((TEST / "vendor_differences.yaml").read_text())
    assert all(row["reason"] for row in rows)
    return {(row["element"].format(side=side), row["property"]): (row["ours"], row["vendor"])
            for row in rows for side in SIDES}


def shape_text(shape):
    """Kind and size of a shape; a mesh is its file, wherever the package keeps it."""
    geometry = shape.geometry
    if isinstance(geometry, Mesh):
        return "Mesh %s %s" % (geometry.filename.partition("/meshes/")[2], geometry.scale)
    sizes = np.hstack([getattr(geometry, item.name) for item in dataclasses.fields(geometry)])
    return " ".join([type(geometry).__name__, *("%.6g" % size for size in sizes)])


def properties(robot, names):
    """Everything that is compared: {(element, property): number, list of numbers or list of text}."""
    table = {}
    for link in robot.links.values():
        element = "link " + names.get(("link", link.name), link.name)
        table[element, "exists"] = True
        if link.inertial is not None:
            table[element, "mass"] = link.inertial.mass
            table[element, "centre of mass"] = link.inertial.centre
            table[element, "inertia"] = link.inertial.inertia.ravel()
        for kind in ("visuals", "collisions"):
            shapes = getattr(link, kind)
            table[element, kind] = [shape_text(shape) for shape in shapes]
            if kind == "collisions" or any(isinstance(shape.geometry, Mesh) for shape in shapes):
                table[element, "origins of " + kind] = np.array([shape.origin for shape in shapes]).ravel()
    for joint in robot.joints.values():
        element = "joint " + names.get(("joint", joint.name), joint.name)
        table[element, "type"] = [joint.type]
        table[element, "parent and child"] = [names.get(("link", link), link) for link in (joint.parent, joint.child)]
        table[element, "origin"] = joint.origin.ravel()
        if joint.movable:  # the vendor gives axes and a limit to fixed joints too; they mean nothing
            table[element, "axis"] = joint.axis
            table[element, "damping and friction"] = [joint.damping, joint.friction]
            table[element, "mimic"] = [str(joint.mimic)]
            for limit, value in dataclasses.asdict(joint.limit).items():
                table[element, limit] = value
    return table


def same(key, ours, vendor):
    try:
        ours, vendor = np.asarray(ours, dtype=float), np.asarray(vendor, dtype=float)
    except (TypeError, ValueError):
        return ours == vendor
    relative, absolute = MASS_TOLERANCE if key[1] in ("mass", "inertia") else TOLERANCE
    return ours.shape == vendor.shape and np.allclose(ours, vendor, rtol=relative, atol=absolute)


@pytest.fixture(scope="module")
def compared(expand, vendor):
    return properties(expand(), {}), properties(vendor, vendor_names())


def test_models_have_the_same_links_and_joints(compared):
    ours, theirs = ({element for element, _ in table} for table in compared)
    assert ours == theirs


def test_every_difference_is_in_the_table_and_every_entry_is_a_difference(compared):
    ours, theirs = compared
    found = {key: (ours.get(key), theirs.get(key)) for key in ours.keys() | theirs.keys()
             if not same(key, ours.get(key), theirs.get(key))}
    listed = differences_table()
    assert sorted(found) == sorted(listed)
    for key, values in found.items():
        assert all(same(key, *pair) for pair in zip(values, listed[key], strict=True)), (key, values)


def test_readme_shows_every_difference():
    readme = (TEST.parent / "README.md").read_text()
    for row in yaml.safe_load((TEST / "vendor_differences.yaml").read_text()):
        assert row["reason"] in readme and "`%s`" % row["element"].split()[1] in readme, row
