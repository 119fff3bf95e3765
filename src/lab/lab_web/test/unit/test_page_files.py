# SPDX-License-Identifier: BSD-3-Clause
"""The page's address and an exercise's result in files of the user."""
import socket
import stat

import pytest

from lab_web import page_files

MASTER = "http://localhost:11311"


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    return tmp_path


def test_the_address_is_found_while_the_page_answers():
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = "http://127.0.0.1:%d/?token=a%%20b" % server.getsockname()[1]
        page_files.write_address(MASTER, address)
        assert page_files.address(MASTER) == address
        assert page_files.address("http://localhost:11411") is None
    assert page_files.address(MASTER) is None
    page_files.remove_address(MASTER, "http://127.0.0.1:1/?token=another")
    assert list(page_files.folder().iterdir()) != []
    for _ in range(2):
        page_files.remove_address(MASTER, address)
    assert list(page_files.folder().iterdir()) == []


@pytest.mark.parametrize("text", ["", "nothing", "http://127.0.0.1:99999/", "http:///"])
def test_another_text_is_no_address(text):
    page_files.write_address(MASTER, text)
    assert page_files.address(MASTER) is None


def test_nobody_else_reads_the_files():
    page_files.write_address(MASTER, "http://127.0.0.1:1/?token=secret")
    page_files.write_result("{}")
    assert stat.S_IMODE(page_files.folder().stat().st_mode) == 0o700
    for path in page_files.folder().iterdir():
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
