# SPDX-License-Identifier: BSD-3-Clause
import sys
from pathlib import Path

# lab_arms, page_server and others are shared by the files of this folder.
sys.path.insert(0, str(Path(__file__).parent))

import pytest  # noqa: E402
from page_server import PAGE, Server, click_until  # noqa: E402

from lab_testing.browser import Browser, why_not  # noqa: E402
from lab_web.libraries import LibrariesError, fetched  # noqa: E402


@pytest.fixture(scope="session")
def libraries():
    if reason := why_not():
        pytest.skip(reason)
    try:
        return fetched(PAGE)
    except LibrariesError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def browser(libraries):
    made = Browser(1000, 800)
    yield made
    made.close()


@pytest.fixture
def lab(libraries, browser, tmp_path):
    """A server whose page has the control of an enabled robot."""
    server = Server(libraries, tmp_path)
    try:
        browser.open(server.address + "drive")
        browser.wait("globalThis.lab?.state.connected && lab.state.robot && lab.view.revision !== null")
        browser.wait("!document.getElementById('control').disabled")
        browser.click("#control")
        browser.wait("lab.state.mine && !document.getElementById('enable').disabled")
        click_until(browser, "#enable", lambda: server.robot.enabled)
        browser.wait("lab.state.robot.enabled")
        browser.errors.clear()
        yield server
        assert browser.errors == []
    finally:
        browser.call("Page.navigate", url="about:blank")
        server.close()
