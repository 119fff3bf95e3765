# SPDX-License-Identifier: BSD-3-Clause
"""The joint-space inertia from the links' masses, for models whose inertias Bullet's own computation refuses."""
import numpy as np

from urdf_model import bounds

from .shapes import principal_axes


def mass_matrix_of(model):
    """Return the joint-space inertia (n, n) of a fixed :class:`Model` at its present position.

    Moments are those that the physics uses: at least ``bounds.LEAST_INERTIA_PER_MASS_M2`` for the mass.
    """
    joints = list(model.merged.joints.values())
    index = {joint.child: i for i, joint in enumerate(joints)}
    frames = {joint.child: model.link_pose(joint.child).matrix() for joint in joints}
    axes = [frames[joint.child][:3, :3] @ joint.axis for joint in joints]
    matrix = np.zeros((len(joints), len(joints)))
    for child, frame in frames.items():
        inertial, rotation = model.merged.links[child].inertial, frame[:3, :3]
        centre = frame[:3, 3] + rotation @ inertial.centre
        moments, principal = principal_axes(rotation @ inertial.inertia @ rotation.T)
        moments = np.maximum(moments, bounds.LEAST_INERTIA_PER_MASS_M2 * inertial.mass)
        moved, turned = np.zeros((3, len(joints))), np.zeros((3, len(joints)))
        link = child
        while link in index:
            i = index[link]
            if joints[i].type == "prismatic":
                moved[:, i] = axes[i]
            else:
                moved[:, i], turned[:, i] = np.cross(axes[i], centre - frames[link][:3, 3]), axes[i]
            link = joints[i].parent
        turned = principal.T @ turned
        matrix += inertial.mass * moved.T @ moved + turned.T @ (moments[:, None] * turned)
    return matrix
