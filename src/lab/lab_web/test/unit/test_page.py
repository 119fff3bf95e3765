# SPDX-License-Identifier: BSD-3-Clause
"""The page's files fit together: texts of both languages, what scripts ask for, libraries and their pins."""
import base64
import hashlib
import io
import json
import re
import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest

from lab_web.libraries import LibrariesError, fetched

PAGE = Path(__file__).resolve().parents[2] / "page"
SCRIPTS = "\n".join(path.read_text(encoding="utf-8") for path in sorted(PAGE.glob("*.js")))
HTML = (PAGE / "index.html").read_text(encoding="utf-8")
TEXTS = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in (PAGE / "texts").glob("*.json")}


def test_both_languages_have_the_same_texts_with_the_same_values_in_them():
    assert set(TEXTS) == {"en", "zh"} and TEXTS["en"].keys() == TEXTS["zh"].keys()
    for key, text in TEXTS["en"].items():
        assert re.findall(r"{\w+}", text) == re.findall(r"{\w+}", TEXTS["zh"][key]), key


def test_every_text_that_the_page_names_exists():
    named = {*re.findall(r'data-(?:text|title|label)="(\w+)"', HTML), *re.findall(r'\btext\("(\w+)"', SCRIPTS),
             *re.findall(r'\bnote\("(\w+)"', SCRIPTS)}
    assert named and named <= TEXTS["en"].keys()


def test_every_element_that_a_script_looks_for_exists():
    wanted = set(re.findall(r'(?:byId|getElementById)\("([\w-]+)"\)', SCRIPTS))
    assert wanted and wanted <= set(re.findall(r'id="([\w-]+)"', HTML))


def test_the_server_and_the_page_know_the_same_codes():
    source = "\n".join(path.read_text(encoding="utf-8") for path in (PAGE.parent / "src" / "lab_web").glob("*.py"))
    codes = {*re.findall(r'told\([\w.]+, "(\w+)"', source), *re.findall(r'NotInControl\("(\w+)"', source)}
    assert {"stopped", "not_in_control", "refused"} <= codes <= TEXTS["en"].keys()


def test_nothing_is_loaded_from_other_hosts():
    for path in PAGE.rglob("*"):
        if path.suffix in (".js", ".css", ".html"):
            assert not re.search(r"https?://", path.read_text(encoding="utf-8")), path.name


def test_libraries_are_pinned_and_listed_with_their_licence():
    pins = json.loads((PAGE / "package.json").read_text())["dependencies"]
    lock = json.loads((PAGE / "package-lock.json").read_text())["packages"]
    listed = (PAGE / "licences.html").read_text(encoding="utf-8")
    for name, entry in lock.items():
        if name:
            package = name.removeprefix("node_modules/")
            assert pins[package] == entry["version"] and entry["integrity"].startswith("sha512-")
            assert "%s.js %s, %s" % (package, entry["version"], entry["license"]) in listed


class Npm:
    """Instead of subprocess.run."""

    def __init__(self, error=None):
        self.error = error
        self.calls = 0

    def __call__(self, command, cwd, **_):
        self.calls += 1
        if self.error:
            raise self.error
        (cwd / "node_modules").mkdir()


@pytest.fixture
def npm_is_there(monkeypatch):
    monkeypatch.setattr("lab_web.libraries.shutil.which", lambda name: "/usr/bin/" + name)


@pytest.mark.usefixtures("npm_is_there")
def test_libraries_are_fetched_once(tmp_path):
    npm = Npm()
    folder = fetched(PAGE, tmp_path, npm)
    assert folder.is_dir() and fetched(PAGE, tmp_path, npm) == folder and npm.calls == 1


@pytest.mark.usefixtures("npm_is_there")
@pytest.mark.parametrize("error", [subprocess.TimeoutExpired("npm", 1),
                                   subprocess.CalledProcessError(1, "npm", "", "no route")])
def test_a_fetch_that_failed_says_why_and_is_tried_again(tmp_path, error):
    with pytest.raises(LibrariesError, match="network"):
        fetched(PAGE, tmp_path, Npm(error))
    assert fetched(PAGE, tmp_path, Npm()).is_dir()


@pytest.fixture
def page_without_npm(tmp_path, monkeypatch):
    """A function that makes a page with one library from a registry on the disk, on a machine without npm."""
    monkeypatch.setattr("lab_web.libraries.shutil.which", lambda name: None)
    monkeypatch.setenv("NPM_CONFIG_REGISTRY", (tmp_path / "registry").as_uri())

    def make(spoilt=b""):
        archive = tmp_path / "registry" / "three" / "-" / "three-1.2.3.tgz"
        archive.parent.mkdir(parents=True)
        with tarfile.open(archive, "w:gz") as files:
            for name in ("package/build/three.module.js", "package/../../outside.js"):
                member = tarfile.TarInfo(name)
                member.size = len(name)
                files.addfile(member, io.BytesIO(name.encode()))
        due = base64.b64encode(hashlib.sha512(archive.read_bytes() + spoilt).digest()).decode()
        page = tmp_path / "page"
        page.mkdir()
        (page / "package.json").write_text("{}")
        packages = {"": {}, "node_modules/three": {"version": "1.2.3", "integrity": "sha512-" + due}}
        (page / "package-lock.json").write_text(json.dumps({"packages": packages}))
        return page
    return make


def test_a_machine_without_npm_downloads_the_same_archive_once(tmp_path, page_without_npm):
    page, told = page_without_npm(), []
    folder = fetched(page, tmp_path / "kept", tell=told.append)
    assert [path.relative_to(folder).as_posix() for path in folder.rglob("*.js")] == ["three/build/three.module.js"]
    assert not list(tmp_path.rglob("outside.js"))
    shutil.rmtree(tmp_path / "registry")
    assert fetched(page, tmp_path / "kept", tell=told.append) == folder
    assert len(told) == 1 and "once" in told[0]


def test_another_archive_than_the_pinned_one_is_refused(tmp_path, page_without_npm):
    with pytest.raises(LibrariesError, match=r"three-1\.2\.3\.tgz is not the file"):
        fetched(page_without_npm(spoilt=b"x"), tmp_path / "kept")
    assert not list((tmp_path / "kept").rglob("*.js"))


def test_a_machine_without_npm_is_told_what_to_install(tmp_path, page_without_npm, monkeypatch):
    monkeypatch.delenv("NPM_CONFIG_REGISTRY")
    with pytest.raises(LibrariesError, match="apt install npm"):
        fetched(page_without_npm(), tmp_path / "kept")


def test_a_machine_without_npm_and_network_is_told_so(tmp_path, page_without_npm):
    page = page_without_npm()
    shutil.rmtree(tmp_path / "registry")
    with pytest.raises(LibrariesError, match="needs a network"):
        fetched(page, tmp_path / "kept")
