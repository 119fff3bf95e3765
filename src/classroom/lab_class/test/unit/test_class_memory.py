# SPDX-License-Identifier: BSD-3-Clause
"""Whether one more lab fits into the machine's memory."""
from lab_class import memory

GB = 10**9


def test_the_kernels_figure(tmp_path):
    (tmp_path / "meminfo").write_text("MemTotal:  4000 kB\nMemFree: 10 kB\nMemAvailable:    2048 kB\n")
    assert memory.available_bytes(tmp_path / "meminfo") == 2 << 20
    assert memory.available_bytes() > 0


def test_a_lab_starts_where_it_fits_beside_those_that_are_starting():
    assert memory.shortage(GB, 2 * GB) == ""
    assert memory.shortage(GB // 2, 2 * GB) == "this machine has only 0.5 GB of memory free"
    assert memory.shortage(GB, 2 * GB, starting=1) != ""
    assert memory.shortage(GB // 2, GB // 4) == "", "labs with a lower limit need less"


def test_thirty_labs_on_a_machine_with_four_gigabytes():
    assert "3.5 GB of memory free" in memory.forecast(30, 3.5 * GB, 2 * GB)
    assert "about 4 of the 30 labs fit" in memory.forecast(30, 3.5 * GB, 2 * GB)
    assert memory.forecast(4, 3.5 * GB, 2 * GB) == ""
