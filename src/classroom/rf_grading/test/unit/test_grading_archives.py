# SPDX-License-Identifier: BSD-3-Clause
"""Archives of submissions: what is read, and what is refused with which sentence."""
import gzip
import io
import tarfile
import zipfile

import pytest

from rf_grading import archives


def is_wanted(name):
    return name.endswith(".py")


def zipped(files, **attributes):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files:
            info = zipfile.ZipInfo(name)
            for key, value in attributes.items():
                setattr(info, key, value)
            archive.writestr(info, content)
    return stream.getvalue()


def tarred(files, mode="w:gz", kind=tarfile.REGTYPE, target=""):
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode=mode) as archive:
        for name, content in files:
            info = tarfile.TarInfo(name)
            info.size, info.type, info.linkname = len(content) if kind == tarfile.REGTYPE else 0, kind, target
            archive.addfile(info, io.BytesIO(content))
    return stream.getvalue()


FILES = [("src/wäve.py", b"a = 1\n"), ("src/report.pdf", b"%PDF"), ("__MACOSX/src/._wave.py", b"\0"), ("./b.py", b"b")]


@pytest.mark.parametrize(("name", "content"), [
    ("li.zip", zipped(FILES)), ("li.tar", tarred(FILES, "w")), ("li.TGZ", tarred(FILES)),
    ("li.tar.gz", tarred(FILES)), ("li.tar.bz2", tarred(FILES, "w:bz2"))])
def test_programs_are_read_and_the_rest_is_named(name, content):
    taken, others = archives.read(content, name, is_wanted)
    assert taken == {"src/wäve.py": b"a = 1\n", "b.py": b"b"}
    assert others == ["src/report.pdf"]


def test_names_in_utf8_without_the_mark_are_read_as_such():
    content = zipped([("w\xe4ve.py", b"")])
    # As old programs write it: the bytes of UTF-8, but no mark.
    data = bytearray(content)
    for place in (content.find(b"PK\x03\x04") + 6, content.find(b"PK\x01\x02") + 8):
        data[place + 1] &= ~0x08
    assert list(archives.read(bytes(data), "a.zip", is_wanted)[0]) == ["w\xe4ve.py"]


@pytest.mark.parametrize("name", ["../a.py", "/etc/a.py", "x/../../a.py", "..\\a.py", "C:/a.py"])
def test_paths_that_lead_out_are_refused(name):
    for content, kind in ((zipped([(name, b"")]), "x.zip"), (tarred([(name, b"")]), "x.tgz")):
        with pytest.raises(archives.BadArchive, match="leads out of its folder"):
            archives.read(content, kind, is_wanted)


@pytest.mark.parametrize(("content", "name", "said"), [
    (zipped(FILES)[:60], "x.zip", "is damaged"), (b"", "x.zip", "is damaged"), (b"no archive", "x.tar", "is damaged"),
    (tarred(FILES)[:40], "x.tar.gz", "is damaged"), (b"\x1f\x8b", "x.tgz", "is damaged"),
    (zipped([("a.py", b"/etc/passwd")], external_attr=0o120777 << 16), "x.zip", "a link"),
    (tarred([("a.py", b"")], kind=tarfile.SYMTYPE, target="/etc/passwd"), "x.tgz", "a link, a.py to /etc/passwd"),
    (tarred([("a.py", b"")], kind=tarfile.LNKTYPE, target="b"), "x.tgz", "a link"),
    (tarred([("a.py", b"")], kind=tarfile.FIFOTYPE), "x.tgz", "not a file"),
    (zipped([("a.py", b"1"), ("./a.py", b"2")]), "x.zip", "two files named a.py"),
    (zipped([("a.py", b"#" * (2 << 20))]), "x.zip", "a.py with more than"),
    (zipped([("%d.py" % k, b"") for k in range(archives.MAX_FILES + 1)]), "x.zip", "more than 200 programs"),
])
def test_other_archives_are_refused_with_a_sentence(content, name, said):
    with pytest.raises(archives.BadArchive, match=said):
        archives.read(content, name, is_wanted)


def test_an_archive_that_unpacks_to_much_is_left_early():
    bounds = archives.ArchiveBounds(10, 1 << 20, 10, 1 << 20)
    # 64 MiB of zeros in 64 KiB, in a file that nobody wants.
    content = tarred([("film.mp4", bytes(64 << 20))])
    with pytest.raises(archives.BadArchive, match="more than 1 MiB"):
        archives.read(content, "x.tgz", is_wanted, bounds)


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.GNUTYPE_LONGNAME, tarfile.GNUTYPE_LONGLINK])
def test_a_description_that_would_fill_the_memory_is_refused(kind):
    stream = io.BytesIO()
    with gzip.GzipFile(fileobj=stream, mode="wb") as file:
        entry = tarfile.TarInfo("x")
        entry.type, entry.size = kind, 2 << 20
        file.write(entry.tobuf() + bytes(entry.size) + tarfile.TarInfo("a.py").tobuf() + bytes(1024))
    with pytest.raises(archives.BadArchive, match="2097152 bytes"):
        archives.read(stream.getvalue(), "li.tgz", is_wanted)


def test_long_names_are_read():
    name = "/".join(["folder"] * 60) + "/a.py"
    for form in (tarfile.PAX_FORMAT, tarfile.GNU_FORMAT):
        stream = io.BytesIO()
        with tarfile.open(fileobj=stream, mode="w:gz", format=form) as archive:
            archive.addfile(tarfile.TarInfo(name))
        assert list(archives.read(stream.getvalue(), "li.tgz", is_wanted)[0]) == [name]


def test_many_entries_are_refused():
    with pytest.raises(archives.BadArchive, match="more than 10 files"):
        archives.read(zipped([("%d.txt" % k, b"") for k in range(11)]), "x.zip", is_wanted,
                      archives.ArchiveBounds(10, 1 << 20, 10, 1 << 20))


MANY = zipped([("%d.txt" % k, b"") for k in range(200)])


def test_a_long_list_is_refused_before_it_is_read(monkeypatch):
    """A million names need a gigabyte of memory."""
    monkeypatch.setattr(archives.zipfile, "ZipInfo", None)
    few = archives.ArchiveBounds(10, 1 << 20, 10, 1 << 20)
    with pytest.raises(archives.BadArchive, match="more than 10 files, or names"):
        archives.read(MANY, "x.zip", is_wanted, few)


def test_a_file_that_wants_more_memory_than_there_is_counts_as_damaged(monkeypatch):
    """LZMA asks for a dictionary as large as the file says, up to 4 GB."""
    def no_memory(*_):
        raise MemoryError

    monkeypatch.setattr(archives, "_zip_content", no_memory)
    with pytest.raises(archives.BadArchive, match="is damaged and cannot be unpacked: MemoryError"):
        archives.read(zipped([("a.py", b"1")]), "x.zip", is_wanted)


def test_an_encrypted_archive_is_refused():
    data = bytearray(zipped([("a.py", b"1")]))
    data[data.find(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(archives.BadArchive, match="encrypted"):
        archives.read(bytes(data), "x.zip", is_wanted)


def test_stems():
    assert [archives.stem(name) for name in ("a.b.tar.gz", "a.zip", "a.TGZ", "a.py")] == ["a.b", "a", "a", "a.py"]
    assert archives.is_other_archive("x.rar") and archives.is_other_archive("x.tar.xz")
    assert not archives.is_other_archive("x.tar.gz")


def test_an_entry_without_a_name_is_told():
    with pytest.raises(archives.BadArchive, match="without a name"):
        archives.read(zipped([("", b"a = 1")]), "a.zip", is_wanted)


@pytest.mark.parametrize("name", ["class.zip", "class.tar"])
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_in_the_archive_of_a_class_a_bad_file_costs_its_folder_alone(name):
    make = zipped if name.endswith("zip") else (lambda files: tarred(files, "w"))
    content = make([("anna/wave.py", b"a = 1"), ("li/../../x.py", b"b"), ("li/wave.py", b"b"), ("max/wave.py", b"1"),
                    ("max/wave.py", b"2")])
    refused = {}
    taken, _ = archives.read(content, name, is_wanted, archives.OF_A_CLASS, refused)
    assert set(taken) == {"anna/wave.py", "li/wave.py", "max/wave.py"}
    assert {path.partition("/")[0] for path in refused} == {"li", "max"}
    # One that begins outside has no folder to belong to.
    with pytest.raises(archives.BadArchive, match="leads out"):
        archives.read(make([("../x.py", b"b")]), name, is_wanted, archives.OF_A_CLASS, {})
