# SPDX-License-Identifier: BSD-3-Clause
"""Wait until a condition holds."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .ros_clock import RosClock
from .waiting import wait_on


def wait_for(test: Any, timeout: float = 1.0, raise_on_error: bool = True, rate: int = 100,
             timeout_msg: str = "timeout expired", body: Callable[[], Any] | None = None) -> bool:
    """Wait until `test()` is true, calling `body()` between the tries.

    `test` is checked first and `body` is called only after it failed: a condition that holds costs nothing and
    publishes nothing. Time is ROS time, so it is simulated time under a simulation.

    Parameters:
        timeout: longest wait [s]; negative or infinite means for ever.
        raise_on_error: raise when the wait fails; otherwise return False.
        rate: tries per second [Hz].
        timeout_msg: text of the exception on time-out.
    Returns True when `test` came true.
    Raises OSError with errno ETIMEDOUT or ESHUTDOWN; rospy.ROSInitException before rospy.init_node.
    """
    return wait_on(RosClock(), test, timeout, raise_on_error, rate, timeout_msg, body)
