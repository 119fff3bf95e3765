# SPDX-License-Identifier: BSD-3-Clause
"""Sub-tests in tests that rostest runs: rosunit would lose what a failed one says."""
import contextlib
import sys
import traceback
import unittest


class TestCase(unittest.TestCase):
    """A `unittest.TestCase` that says at its end which of its sub-tests failed, and why; all of them run."""

    @contextlib.contextmanager
    def subTest(self, *message, **parameters):  # noqa: N802  (unittest's name)
        """As unittest's: the test goes on after a failure in the block."""
        title = ", ".join([*map(str, message), *("%s=%r" % pair for pair in parameters.items())])
        try:
            yield
        except unittest.SkipTest:
            raise
        except Exception:  # noqa: BLE001  (whatever it is, it fails this sub-test)
            text = "(%s)\n%s" % (title, traceback.format_exc())
            # rosunit keeps what is printed until all tests are through.
            print("failed: %s" % text, file=sys.__stderr__, flush=True)
            if not getattr(self, "_failed", None):
                self._failed = []
                self.addCleanup(self._report_failed)
            self._failed.append(text)

    def _report_failed(self):
        failed, self._failed = self._failed, []
        self.fail("%d sub-tests failed:\n%s" % (len(failed), "\n".join(failed)))
