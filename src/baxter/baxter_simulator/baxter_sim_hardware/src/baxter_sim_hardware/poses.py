# SPDX-License-Identifier: BSD-3-Clause
"""Named poses of the arms, from config/poses.yaml (which explains its own layout)."""
from .errors import PoseError


class Poses:
    """Joint angles by pose name, for every side.

    table: the parsed content of poses.yaml. Raises PoseError where that content is incomplete.
    """

    def __init__(self, table):
        self._mirror = table["mirror"]
        self._poses = table["poses"]
        for name, pose in self._poses.items():
            for given in pose.values():
                if set(given) != set(self._mirror):
                    raise PoseError("pose '%s' gives %s; it must give %s" % (
                        name, ", ".join(given), ", ".join(self._mirror)))

    @property
    def names(self):
        return tuple(self._poses)

    def angles(self, name, side):
        """{joint name: angle [rad]} of one arm; the side that is not given is the mirror image of the one that is.

        Raises PoseError for an unknown pose.
        """
        try:
            pose = self._poses[name]
        except KeyError:
            raise PoseError("unknown pose '%s'; choices are %s" % (name, ", ".join(self._poses))) from None
        if side in pose:
            angles, signs = pose[side], dict.fromkeys(self._mirror, 1)
        else:
            angles, signs = next(iter(pose.values())), self._mirror
        return {"%s_%s" % (side, joint): signs[joint] * angle + 0.0 for joint, angle in angles.items()}


def clamp_to_limits(angles, limits):
    """{joint: angle} brought inside {joint: (lower, upper)} [rad]; joints without an entry are left as they are."""
    return {joint: min(max(angle, limits[joint][0]), limits[joint][1]) if joint in limits else angle
            for joint, angle in angles.items()}
