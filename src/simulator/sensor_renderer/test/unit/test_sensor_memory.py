# SPDX-License-Identifier: BSD-3-Clause
"""Memory of large messages."""
import subprocess
import sys

import pytest

# A cloud of 640 x 480 points is serialised ten times; the number of pages that the system had to give for it.
PROGRAM = """
import io, resource
from sensor_msgs.msg import PointCloud2
from processes.memory import keep_freed_memory
if %r:
    keep_freed_memory()
cloud = PointCloud2(data=bytes(16 * 640 * 480))
for count in range(13):
    cloud.serialize(io.BytesIO())
    if count == 2:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.parametrize(("keep", "least", "most"), [(False, 10000, 1e9), (True, 0, 100)])
def test_freed_memory_is_used_again(keep, least, most):
    program = [sys.executable, "-c", PROGRAM % keep]
    assert least <= int(subprocess.run(program, check=True, capture_output=True, text=True).stdout) <= most
