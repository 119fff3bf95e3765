# SPDX-License-Identifier: BSD-3-Clause
"""Sends the true requests and responses of the IK service to the recorder: an observer of position_kinematics.

Any program can publish on the topic IKReport; the socket is in the lab's sandbox only.
"""
from __future__ import annotations

import contextlib
import json
import os
import socket
from typing import Any

from rf_checks.recorder_names import REQUESTS, SOCKETS_VARIABLE

#: Largest number of poses sent of one request; a datagram holds many more.
POSES_TOLD = 100
# Longest wait for the recorder, which reads once in 10 ms of simulation; simulation may pause for a while [s].
_PATIENCE_S = 2.0


class Witness:
    """Called with each request's caller (node name) and report (IKReport), before the client has its answer."""

    def __init__(self) -> None:
        self._path = os.path.join(os.environ[SOCKETS_VARIABLE], REQUESTS)

    def __call__(self, caller: str, report: Any) -> None:
        told = []
        for verdict in report.verdicts[:POSES_TOLD]:
            pose = verdict.target.pose
            told.append([report.limb, verdict.target.header.frame_id,
                         [getattr(pose.position, axis) for axis in "xyz"],
                         [getattr(pose.orientation, axis) for axis in "xyzw"], verdict.verdict])
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.settimeout(_PATIENCE_S)
            sender.sendto(json.dumps({"caller": caller, "poses": told}).encode(), self._path)
