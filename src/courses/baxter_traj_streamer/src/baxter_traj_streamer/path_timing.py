# SPDX-License-Identifier: BSD-3-Clause
"""The service through which the C++ library times paths; the rules themselves are in timing and streamer."""
from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy

from .settings import SIDES, arm_joint_names
from .srv import TimePath, TimePathResponse  # pyright: ignore[reportMissingImports]  (generated)
from .streamer import stuff_trajectory
from .timing import transition_time

if TYPE_CHECKING:
    from baxter_traj_streamer.settings import StreamerSettings

SERVICE = "/baxter_traj_streamer/time_path"


def serve(settings: StreamerSettings) -> rospy.Service:
    """Offer the service from now on. Invalid paths are refused with the library's error text."""
    def answer(request: Any) -> TimePathResponse:
        side = next((side for side in SIDES if request.path.joint_names == arm_joint_names(side)), None)
        if side is None:
            raise rospy.ServiceException("joint_names must be %s, or the same of the left arm; got %s" % (
                ", ".join(arm_joint_names("right")), ", ".join(request.path.joint_names) or "none"))
        path = [point.positions for point in request.path.points]
        try:
            trajectory = stuff_trajectory(path, side, settings)
            times = [transition_time(np.subtract(there, here), settings.planning_velocity())
                     for here, there in itertools.pairwise(path)]
            return TimePathResponse(trajectory=trajectory, transition_times=times)
        except ValueError as error:
            raise rospy.ServiceException(str(error)) from error

    return rospy.Service(SERVICE, TimePath, answer)
