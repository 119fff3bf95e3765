# SPDX-License-Identifier: BSD-3-Clause
"""The node for a terminal: keys in, twists out, the servo's reason on screen."""
from __future__ import annotations

import argparse
import contextlib
import curses
import os
import sys
import time

import rospy

from rospy_fixes.ports.event_log import printable
from rospy_nodes.start import limit_ports
from steering_devices.hands import Hands, hands_of
from steering_devices.steering import MOTIONS, OTHER_KEYS, KeyboardSteering

_PERIOD_S, _DRAWN_EVERY_S = 0.02, 0.1
_DESCRIPTION = """Steer by the keys of this terminal. Publishes: twists to the servos, /steering/mark.
Parameters: ~servos, ~grippers, ~linear_speed [m/s], ~angular_speed [rad/s].
"""


def main() -> None:
    argparse.ArgumentParser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args(
        rospy.myargv()[1:])
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        sys.exit("servo_keyboard: it reads the keys of a terminal; start it with rosrun in one")
    try:
        curses.setupterm(fd=1)
    except curses.error:
        sys.exit("servo_keyboard: the terminal '%s' is not known here; set TERM to one that is, as xterm"
                 % os.environ.get("TERM", ""))
    limit_ports()
    rospy.init_node("servo_keyboard", disable_signals=True, anonymous=True)
    hands = hands_of("servo_keyboard")
    try:
        curses.wrapper(_run, hands)
    except KeyboardInterrupt:
        pass
    finally:
        rospy.signal_shutdown("the end")


def _run(screen: curses.window, hands: Hands) -> None:
    with contextlib.suppress(curses.error):  # a terminal that cannot hide its cursor
        curses.curs_set(0)
    screen.nodelay(True)
    keyboard, drawn = KeyboardSteering(len(hands)), -1e9
    while not rospy.is_shutdown():
        now = time.monotonic()
        while (code := screen.getch()) >= 0:
            keyboard.press(chr(code).lower() if code < 128 else "", now)
        steering = keyboard.take(now)
        hands.send(steering)
        if steering.ends:
            return
        if now - drawn > _DRAWN_EVERY_S:
            drawn = now
            _draw(screen, hands, keyboard, steering)
        time.sleep(_PERIOD_S)


def _draw(screen: curses.window, hands: Hands, keyboard: KeyboardSteering, steering) -> None:
    hand = hands.hands[steering.hand]
    keys = ["%-6s %s" % (repr(key).strip("'") if key != " " else "space", what[0] if isinstance(what, tuple) else what)
            for key, what in {**MOTIONS, **OTHER_KEYS}.items()]
    state = "" if hand.is_there else "; it does not listen: is it running?"
    lines = ["hand: %s%s" % (hand.name, state), "axes: %s   speed: %.0f %%" % (
        "tool" if steering.in_tool else "base", 100.0 * keyboard.speed_share),
        "held back: %s" % (hand.reason or "nothing"), "", "Hold a key to move.", *keys]
    screen.erase()
    height, width = screen.getmaxyx()
    for row, line in enumerate(lines[: height - 1]):
        screen.addnstr(row, 0, printable(line), width - 1)  # curses refuses a text that has a zero in it
    screen.refresh()
