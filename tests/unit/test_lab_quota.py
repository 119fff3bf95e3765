# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh test --busy`: which control group is made, its settings, and the error if none can be made."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

import run_tests
from lab_tests import quota
from lab_tests.discovery import select, take_inventory
from lab_tests.quota import ProcessorQuota, QuotaError

ROOT = Path(__file__).resolve().parents[2]


class FakeMount:
    """Folders and files as in the kernel; a new folder has no files until something is written."""

    def __init__(self, folder, own, files):
        self.mount, self.own = folder / "cgroup", folder / "own"
        self.own.write_text(own)
        for name, text in files.items():
            (self.mount / name).parent.mkdir(parents=True, exist_ok=True)
            (self.mount / name).write_text(text)

    def quota(self, percent):
        return ProcessorQuota(percent, self.mount, self.own)

    def groups(self):
        return {str(path.parent.relative_to(self.mount)): {f.name: f.read_text() for f in path.parent.iterdir()}
                for path in self.mount.rglob("cgroup.procs") if path.parent.name.startswith("lab_quota")}


@pytest.mark.parametrize(("own", "files", "parent", "limit"), [
    ("1:cpu:/\n", {"cpu/cpu.cfs_quota_us": "-1"}, "cpu", {"cpu.cfs_quota_us": "20000", "cpu.cfs_period_us": "50000"}),
    ("4:cpu,cpuacct:/user\n", {"cpu,cpuacct/user/cpu.cfs_quota_us": "-1"}, "cpu,cpuacct/user",
     {"cpu.cfs_quota_us": "20000", "cpu.cfs_period_us": "50000"}),
    ("0::/\n", {"cgroup.controllers": "cpu", "cgroup.subtree_control": "cpu"}, ".", {"cpu.max": "20000 50000"}),
    ("0::/user/shell\n", {"cgroup.controllers": "cpu", "cgroup.subtree_control": "cpu",
                          "user/cgroup.subtree_control": "memory cpu", "user/shell/cgroup.subtree_control": ""},
     "user", {"cpu.max": "20000 50000"}),
], ids=["v1", "v1 with two controllers", "v2 at the root", "v2 with a delegated parent"])
def test_the_quota_goes_into_a_group_of_its_own(monkeypatch, tmp_path, own, files, parent, limit):
    fake = FakeMount(tmp_path, own, files)
    monkeypatch.setattr(quota, "REMOVAL_S", 0.0)  # a folder of files cannot be removed as a group can
    with fake.quota(40):
        (name, written), = fake.groups().items()
    assert Path(name).parent == Path(parent)
    assert written == {**limit, "cgroup.procs": str(os.getpid())}


def test_without_control_groups_it_says_so(tmp_path):
    with pytest.raises(QuotaError, match="no control groups with a cpu controller"), \
            FakeMount(tmp_path, "0::/\n", {}).quota(40):
        pass


def test_what_the_kernel_refuses_is_passed_on(tmp_path):
    fake = FakeMount(tmp_path, "1:cpu:/\n", {"cpu/cpu.cfs_quota_us": "-1"})
    (fake.mount / "cpu" / f"lab_quota.{os.getpid()}").write_text("a file is in the way")
    with pytest.raises(QuotaError, match=os.strerror(errno.EEXIST)), fake.quota(40):
        pass


@pytest.mark.parametrize("percent", [0, -5, float("nan"), 1e9])
def test_impossible_shares_are_refused(percent):
    with pytest.raises(ValueError, match="between 1 and"):
        ProcessorQuota(percent)


def test_the_kernel_keeps_to_it():
    """A child that computes gets a fifth of a core, and the parent its whole share back afterwards."""
    program = """
import sys, time
sys.path.insert(0, sys.argv[1])
from lab_tests.quota import ProcessorQuota, QuotaError
try:
    with ProcessorQuota(20):
        begin, used = time.monotonic(), time.process_time()
        while time.monotonic() - begin < 2.0:
            pass
        print((time.process_time() - used) / (time.monotonic() - begin))
except QuotaError as error:
    print("none", error)
"""
    command = [sys.executable, "-c", program, str(ROOT / "tools")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    if done.stdout.startswith("none"):
        pytest.skip(done.stdout)
    assert float(done.stdout) < 0.3


def test_its_names_are_tests_that_exist():
    targets = select(take_inventory(ROOT), list(run_tests.MAIN_FLOWS), ROOT).targets
    assert len(targets) == len(run_tests.MAIN_FLOWS)


@pytest.mark.parametrize(("words", "expected"), [
    ([], []),
    (["--busy"], ["--busy=40"]),
    (["--busy=20", "a.test"], ["--busy=20", "a.test"]),
    (["--busy", "a.test"], ["--busy=40", "a.test"]),
    (["--busy", "20", "a.test"], ["--busy", "20", "a.test"]),
    (["a.test", "--busy"], ["a.test", "--busy=40"]),
])
def test_a_name_after_it_is_no_share(words, expected):
    assert run_tests.separate_values(words) == expected


def test_the_runner_skips_with_an_exit_code_of_its_own(monkeypatch, capsys):
    def refuse(*_):
        raise QuotaError("read-only")

    monkeypatch.setattr(run_tests, "run", refuse)
    assert run_tests.main(["--busy", "test_lab_quota.py"]) == run_tests.EXIT_SKIPPED
    assert "skipped" in capsys.readouterr().out


STRETCHED = """<launch><test test-name="slow" pkg="workspace_tests" type="sleeps.py" time-limit="0.5"/></launch>"""


def test_time_limits_of_files_are_stretched(monkeypatch, tmp_path):
    """Through roslaunch's own loader, as rostest reads the file."""
    path = tmp_path / "slow.test"
    path.write_text(STRETCHED)
    program = """
import sys, runpy
import rostest
import roslaunch
def main():
    config = roslaunch.config.load_config_default([sys.argv[1]], None)
    print([test.time_limit for test in config.tests])
rostest.rostestmain = main
runpy.run_path(sys.argv[2], run_name="__main__")
"""
    script = ROOT / "tools/lab_tests/stretched_rostest.py"
    done = subprocess.run([sys.executable, "-c", program, str(path), str(script)], capture_output=True, text=True,
                          env={**os.environ, "LAB_TEST_STRETCH": "5"}, timeout=120)
    assert done.stdout == "[2.5]\n", done.stderr
