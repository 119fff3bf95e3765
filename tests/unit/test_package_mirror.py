# SPDX-License-Identifier: BSD-3-Clause
"""docker/package_mirror.pl: sources of base images with any addresses are changed to the given mirror."""
import os
import shutil
import subprocess

import pytest

SCRIPT = os.path.join(os.path.dirname(__file__), "..", "..", "docker", "package_mirror.pl")
MIRROR = "https://mirror.example/some/debian"


@pytest.fixture
def point(tmp_path):
    """Run the script on a file of the given name and text; the text that it leaves."""
    if shutil.which("perl") is None:
        pytest.skip("no perl on this machine")

    def run(name, text, mirror=MIRROR, codename="bookworm", status=0):
        path = tmp_path / name
        path.write_text(text)
        ended = subprocess.run(["perl", SCRIPT, codename, mirror, str(path), str(tmp_path / "missing.list")],
                               capture_output=True, text=True, timeout=60)
        assert ended.returncode == status, ended.stderr
        return path.read_text() if status == 0 else ended.stderr

    return run


@pytest.mark.parametrize("host", ["http://deb.example.org", "https://cache.example:8443/apt", "http://10.0.0.1"])
def test_stanzas_of_any_host(point, host):
    before = (f"Types: deb\n# from {host}/debian\nURIs: {host}/debian\nSuites: bookworm bookworm-updates\n"
              f"Components: main\nSigned-By: /usr/share/keyrings/key.gpg\n\n"
              f"Types: deb\nURIs: {host}/debian-security\nSuites: bookworm-security\nComponents: main\n")
    after = point("debian.sources", before)
    assert f"URIs: {MIRROR}\nSuites: bookworm bookworm-updates\n" in after
    assert f"URIs: {MIRROR}-security\nSuites: bookworm-security\n" in after
    assert after.replace(f"{MIRROR}", f"{host}/debian") == before


@pytest.mark.parametrize("options", ["", "[arch=amd64 signed-by=/usr/share/keyrings/key.gpg] "])
def test_lines_of_any_host(point, options):
    before = (f"# deb http://old.example/debian bookworm main\n"
              f"deb {options}http://old.example/debian bookworm main contrib\n"
              f"deb-src {options}http://old.example/debian/ bookworm-updates main\n"
              f"deb {options}http://other.example/debian-security bookworm-security main\n")
    assert point("sources.list", before) == (
        f"# deb http://old.example/debian bookworm main\ndeb {options}{MIRROR} bookworm main contrib\n"
        f"deb-src {options}{MIRROR} bookworm-updates main\ndeb {options}{MIRROR}-security bookworm-security main\n")


def test_a_slash_at_the_mirrors_end_is_left_out(point):
    assert point("sources.list", "deb http://old.example/debian bookworm main\n", mirror=MIRROR + "/") == (
        f"deb {MIRROR} bookworm main\n")


def test_addresses_on_lines_of_their_own(point):
    before = ("Types: deb\nURIs: http://a.example/ubuntu/\n http://b.example/ubuntu\nSuites: jammy\n"
              "Components: main universe\n")
    after = point("ubuntu.sources", before, codename="jammy", mirror="http://m.example/ubuntu")
    assert after == ("Types: deb\nURIs: http://m.example/ubuntu\n http://m.example/ubuntu\nSuites: jammy\n"
                     "Components: main universe\n")


def test_other_peoples_sources_stay(point):
    theirs = "deb https://engine.example/linux/debian bookworm stable\n"
    assert point("sources.list", "deb http://old.example/debian bookworm main\n" + theirs) == (
        f"deb {MIRROR} bookworm main\n" + theirs)


def test_says_when_there_was_nothing_to_change(point):
    message = point("sources.list", "deb http://old.example/debian trixie main\n", status=1)
    assert "no source of bookworm main" in message


def test_the_dockerfile_names_no_package_address():
    with open(os.path.join(os.path.dirname(SCRIPT), "Dockerfile")) as dockerfile:
        commands = [line for line in dockerfile if not line.startswith("#")]
    assert not [line for line in commands if "://" in line]
