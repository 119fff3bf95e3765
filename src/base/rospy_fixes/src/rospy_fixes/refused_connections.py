# SPDX-License-Identifier: BSD-3-Clause
"""Log once when a publisher refuses a subscriber.

rospy writes that only to the node's log file: a program that subscribes with another type or version than the
publisher's waits for ever without a message.
"""
from __future__ import annotations

import functools
from typing import Any

# A publisher with a new answer each time must fill neither memory nor terminal.
MAX_LINES, LONGEST_REASON = 100, 300


def amend(tcpros_base: Any) -> None:
    """Make the subscribers of rospy.impl.tcpros_base log a publisher's refusal."""
    validate = tcpros_base.TCPROSTransport._validate_header
    told = set()

    @functools.wraps(validate)
    def validate_and_tell(self, header):
        # Service clients raise the answer themselves.
        reason = header.get("error", "")[:LONGEST_REASON]
        # A terminal must not obey what a publisher answers.
        reason = "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in reason)
        is_service = self.protocol.direction == tcpros_base.BIDIRECTIONAL
        key = (self.name, self.endpoint_id, reason)
        if reason and not is_service and key not in told and len(told) < MAX_LINES:
            told.add(key)
            tcpros_base.logerr("%s: no data from %s, which answers: %s", self.name, self.endpoint_id, reason)
        return validate(self, header)

    tcpros_base.TCPROSTransport._validate_header = validate_and_tell
