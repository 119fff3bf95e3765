# SPDX-License-Identifier: BSD-3-Clause
"""Log once when a publisher refuses a subscriber.

rospy writes that to the node's log file alone, where nobody looks: a program that subscribes with another type than
the publisher's, or with another version of it, hangs without a word.
"""
import functools

# A publisher that answers something else each time shall fill neither the memory nor the terminal.
MOST_LINES, LONGEST_REASON = 100, 300


def amend(tcpros_base):
    """Have rospy.impl.tcpros_base's subscribers log what publishers answer instead of data."""
    validate = tcpros_base.TCPROSTransport._validate_header
    told = set()

    @functools.wraps(validate)
    def validate_and_tell(self, header):
        # Clients of services raise what they are answered.
        reason = header.get("error", "")[:LONGEST_REASON]
        is_service = self.protocol.direction == tcpros_base.BIDIRECTIONAL
        key = (self.name, self.endpoint_id, reason)
        if reason and not is_service and key not in told and len(told) < MOST_LINES:
            told.add(key)
            tcpros_base.logerr("%s: no data from %s, which answers: %s", self.name, self.endpoint_id, reason)
        return validate(self, header)

    tcpros_base.TCPROSTransport._validate_header = validate_and_tell
