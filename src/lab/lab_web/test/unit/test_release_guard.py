# SPDX-License-Identifier: BSD-3-Clause
"""Which buttons are released behind a server that was killed."""
import pytest

from lab_web.release_guard import ReleaseGuard, pressed_at_the_end


@pytest.mark.parametrize(("lines", "names"), [
    ([], []), ([b'["cuff"]\n'], ["cuff"]), ([b'["cuff"]\n', b"[]\n"], []), ([b'["cuff"]\n', b'["cuff", "o'], ["cuff"])])
def test_the_last_whole_line_counts(lines, names):
    assert pressed_at_the_end(lines) == names


def test_a_guard_that_has_been_ended_holds_nothing_up():
    guard = ReleaseGuard()
    guard.pressed({"cuff"})
    guard._process.kill()
    guard._process.wait()
    for _ in range(3):
        guard.pressed({"ok"})
    guard.close()
