# SPDX-License-Identifier: BSD-3-Clause
"""Write both arms' joint angles and grippers to a file while they move."""
from __future__ import annotations

import os
from collections.abc import Iterator

import rospy

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch, Ticker
from baxter_interface import Limb
from baxter_interface.joint_checks import require_number
from baxter_model import SIDES

from .mounted_grippers import mounted_grippers
from .recording import COLUMNS, write_row


class JointRecorder:
    """Records into the file `filename`, `rate` times a second of ROS time.

    Raises as Limb; ValueError for a bad rate.
    """

    def __init__(self, filename: str | os.PathLike[str], rate: float) -> None:
        self._rate_hz = require_number(rate, "the rate [Hz]")
        if self._rate_hz <= 0.0:
            raise ValueError("the rate [Hz] must be above 0, got %r" % rate)
        self._filename = filename
        self._done = False
        self._limbs = {side: Limb(side) for side in SIDES}
        self.grippers = mounted_grippers(SIDES)

    def stop(self) -> None:
        """End the recording."""
        self._done = True

    def done(self) -> bool:
        """Tell whether the recording has ended, or ROS has."""
        if rospy.is_shutdown():
            self.stop()
        return self._done

    def record(self, beats: Iterator[object] | None = None) -> None:
        """Record until stop() or ROS's end. `beats`: an iterator to keep time by, ending the recording when it ends.

        Raises OSError if the file cannot be written.
        """
        clock = RosClock()
        ticker = Ticker(clock, self._rate_hz)
        watch = Stopwatch(clock.now())
        self._done = False
        with open(self._filename, "w", encoding="utf-8") as stream:
            write_row(stream, COLUMNS)
            last_s = None
            while not self.done():
                time_s = watch.elapsed_s(clock.now())
                if time_s != last_s:
                    write_row(stream, self._row(time_s))
                    last_s = time_s
                if beats is None:
                    ticker.sleep()
                elif next(beats, self) is self:
                    return

    def _row(self, time_s: float):
        row = [time_s]
        for side, limb in self._limbs.items():
            angles = limb.joint_angles()
            row += [angles[name] for name in limb.joint_names()]
            row.append(self.grippers[side].position() if side in self.grippers else 0.0)
        return row
