# SPDX-License-Identifier: BSD-3-Clause
"""Lets a SimpleActionClient hear of its goal from the beginning.

actionlib publishes a goal first, and notes then which goal it follows. What the server answered in between, in other
threads, counted as news about a goal that nobody follows: feedback was lost, and where the goal had already ended,
`wait_for_result` waited for ever.
"""
from __future__ import annotations

import functools
import threading
from typing import Any


def amend(simple_action_client: Any) -> None:
    """Make the clients of actionlib.simple_action_client take news of goals when no goal is just being sent."""
    client = simple_action_client.SimpleActionClient
    send = client.send_goal

    @functools.wraps(send)
    def send_goal(self, *arguments, **options):
        with _sending(self):
            return send(self, *arguments, **options)

    def after_sending(handle):
        @functools.wraps(handle)
        def handle_news(self, *news):
            # Not held while the news is handled: the user's callbacks run there, and may send a goal.
            with _sending(self):
                pass
            return handle(self, *news)
        return handle_news

    client.send_goal = send_goal
    client._handle_transition = after_sending(client._handle_transition)
    client._handle_feedback = after_sending(client._handle_feedback)


def _sending(client):
    """The lock of one client; a callback may send a goal in its own thread."""
    return vars(client).setdefault("_sending_lock", threading.RLock())
