# SPDX-License-Identifier: BSD-3-Clause
"""Archives of submissions, read without trust: nothing is unpacked to disk, and sizes are limited while they are read.

Only programs and notebooks are read; other files, such as a report or a film, are skipped by their names.
"""
from __future__ import annotations

import bz2
import gzip
import io
import lzma
import posixpath
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from rf_checks.submission import LARGEST_BYTES

if TYPE_CHECKING:
    from pathlib import Path

#: Endings of archives that are read, and of those that are named as archives of another kind.
SUFFIXES = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tbz")
OTHER_SUFFIXES = (".7z", ".rar", ".tar.xz", ".txz", ".tar.zst", ".gz", ".bz2", ".xz")
#: Most programs of a submission, and their most bytes.
MAX_FILES, MAX_TAKEN_BYTES = 200, 16 << 20
#: Most bytes of an archive inside a submission: students pack their reports and films, too.
MAX_ARCHIVE_BYTES = 256 << 20
# MemoryError: a dictionary of 4 GB for a small file.
_DAMAGED = (zipfile.BadZipFile, tarfile.TarError, zlib.error, lzma.LZMAError, EOFError, ValueError, OSError,
            NotImplementedError, RuntimeError, UnicodeError, MemoryError)
# Entries of a tar file that describe the next one, such as a long name; tarfile reads them whole.
_DESCRIPTIONS = (tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.SOLARIS_XHDTYPE, tarfile.GNUTYPE_LONGNAME,
                 tarfile.GNUTYPE_LONGLINK)
_MAX_DESCRIPTION_BYTES = 1 << 20
# Of a zip file's list for each of its entries, with a long path.
_LISTED_BYTES = 512
_UTF8_FLAG, _ENCRYPTED_FLAG = 0x800, 0x1
_LINK, _FILE_KIND, _REGULAR = 0o120000, 0o170000, 0o100000


@dataclass(frozen=True)
class ArchiveBounds:
    """Most entries of an archive, its most unpacked bytes, the most files that are taken from it and their most
    bytes."""

    entries: int
    bytes: int
    files: int
    taken_bytes: int


OF_A_STUDENT = ArchiveBounds(10_000, 1 << 30, MAX_FILES, MAX_TAKEN_BYTES)
#: The export of a whole class: a thousand submissions.
OF_A_CLASS = ArchiveBounds(500_000, 32 << 30, 50_000, 1 << 30)


class BadArchive(Exception):
    """An archive that is not read; the text says why."""


def is_archive(name: str) -> bool:
    return name.lower().endswith(SUFFIXES)


def is_other_archive(name: str) -> bool:
    return name.lower().endswith(OTHER_SUFFIXES) and not is_archive(name)


def stem(name: str) -> str:
    """The name of an archive without its ending."""
    ending = max((suffix for suffix in SUFFIXES + OTHER_SUFFIXES if name.lower().endswith(suffix)), key=len, default="")
    return name[:len(name) - len(ending)] if ending else name


def is_litter(name: str) -> bool:
    """Whether a path belongs to what systems and editors add by themselves."""
    parts = name.split("/")
    return any(part in ("__MACOSX", "__pycache__", ".ipynb_checkpoints", ".git") or part.startswith("._")
               for part in parts) or parts[-1] in (".DS_Store", "Thumbs.db", "desktop.ini")


def most_bytes(name: str) -> int:
    """How large a file of this name may be. Notebooks hold pictures, which are not judged."""
    if is_archive(name):
        return MAX_ARCHIVE_BYTES
    return MAX_TAKEN_BYTES if name.lower().endswith(".ipynb") else LARGEST_BYTES


def safe_name(name: str) -> str:
    """The normal form of a path in an archive. Raises BadArchive if it leads out of the archive's folder."""
    plain = name.replace("\\", "/")
    if plain.startswith("/") or ":" in plain.partition("/")[0] or ".." in plain.split("/") or "\0" in plain:
        raise BadArchive("holds a file whose path leads out of its folder: %s" % name)
    return posixpath.normpath(plain)


def read(source: Path, name: str, is_wanted: Callable[..., Any], bounds: ArchiveBounds = OF_A_STUDENT,
         refused: dict[str, Any] | None = None) -> tuple[dict[str, bytes], list[str]]:
    """{path in the archive: bytes} of the wanted files, and the list of the other files' paths.

    source: path, or bytes. name: its name, which tells the kind. is_wanted: function of a path. bounds:
    ArchiveBounds. refused: a dict that gets {path: sentence} of files that are not read, as links and what is too
    large; None: such an archive is refused. Raises BadArchive.
    """
    try:
        with (io.BytesIO(source) if isinstance(source, bytes) else open(source, "rb")) as stream:
            entries = _zip_entries(stream, bounds) if name.lower().endswith(".zip") else _tar_entries(
                stream, name.lower(), bounds)
            return _take(entries, is_wanted, bounds, refused)
    except _DAMAGED as error:
        raise BadArchive("is damaged and cannot be unpacked: %s" % (str(error) or type(error).__name__)) from error


def _take(entries: Iterator[Any], is_wanted: Callable[[Any], bool], bounds: ArchiveBounds,
          refused: dict[str, Any] | None) -> tuple[dict[str, bytes], list[str]]:
    taken, others, seen, size = {}, [], set(), 0
    for count, (name, problem, read_it) in enumerate(entries, 1):
        if count > bounds.entries:
            raise BadArchive("holds more than %d files" % bounds.entries)
        try:
            path = safe_name(name)
            if is_litter(path):
                continue
            if path in seen:
                raise BadArchive("holds two files named %s" % path)
            seen.add(path)
            if problem:
                raise BadArchive(problem)
            if not is_wanted(path):
                others.append(path)
                continue
            content = read_it()
            if len(content) > most_bytes(path):
                raise BadArchive("holds %s with more than %d bytes" % (path, most_bytes(path)))
        except (BadArchive, *_DAMAGED) as error:
            # In the archive of a class it belongs to the student in whose folder it is.
            if refused is None or not _is_in_a_folder(name):
                raise
            refused[name.replace("\\", "/")] = str(error) if isinstance(error, BadArchive) else (
                "holds %s, which is damaged" % name)
            continue
        size += len(content)
        if len(taken) >= bounds.files or size > bounds.taken_bytes:
            raise BadArchive("holds more than %d programs, or %d MiB of them" % (
                bounds.files, bounds.taken_bytes >> 20))
        taken[path] = content
    return taken, others


def _is_in_a_folder(name: str) -> bool:
    """Whether a path begins with the name of a folder in the archive."""
    top, slash, _ = name.replace("\\", "/").partition("/")
    return bool(slash) and top not in ("", ".", "..") and not set(top) & set(":\0")


class _ListLimited:
    """A file of which no more than the list of `entries` files is read at once, until `most` is None: zipfile reads the
    whole list before it gives the first one, and needs a kilobyte of memory for each."""

    def __init__(self, stream: BinaryIO, entries: int) -> None:
        self._stream, self._entries = stream, entries
        self.most: int | None = _LISTED_BYTES * entries

    def __getattr__(self, name: str) -> str | Callable[..., Any]:
        return getattr(self._stream, name)

    def read(self, size: int = -1) -> bytes:
        if self.most is not None and size > self.most:
            raise BadArchive("holds more than %d files, or names of unusual length" % self._entries)
        return self._stream.read(size)


def _zip_entries(stream: BinaryIO, bounds: ArchiveBounds) -> Iterator[tuple[Any, ...]]:
    limited = _ListLimited(stream, bounds.entries)
    with zipfile.ZipFile(cast("BinaryIO", limited)) as archive:
        limited.most = None
        for info in archive.infolist():
            kind, path, problem = info.external_attr >> 16 & _FILE_KIND, _zip_name(info), ""
            # Not is_dir(), which fails for a name that is empty.
            if path.endswith("/"):
                continue
            if not path:
                problem = "holds a file without a name"
            elif kind == _LINK:
                problem = "holds a link, %s; links are not followed" % path
            elif kind not in (0, _REGULAR):
                problem = "holds %s, which is not a file" % path
            elif info.flag_bits & _ENCRYPTED_FLAG:
                problem = "is encrypted"
            yield path, problem, lambda info=info, path=path: _zip_content(archive, info, most_bytes(path) + 1)


def _zip_content(archive: zipfile.ZipFile, info: zipfile.ZipInfo, most: int) -> bytes:
    with archive.open(info) as file:
        return file.read(most)


def _zip_name(info: zipfile.ZipInfo) -> str:
    """Names without the mark for UTF-8 are often UTF-8 all the same; zipfile has read them as code page 437."""
    if info.flag_bits & _UTF8_FLAG:
        return info.filename
    try:
        return info.filename.encode("cp437").decode("utf-8")
    except UnicodeError:
        return info.filename


class _Limited(io.RawIOBase):
    """A stream that ends with BadArchive after `most` bytes."""

    def __init__(self, stream: BinaryIO, most: int) -> None:
        self._stream, self._left, self._most = stream, most, most

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        data = self._stream.read(min(size, 1 << 20) if size >= 0 else 1 << 20)
        self._left -= len(data)
        if self._left < 0:
            raise BadArchive("holds more than %d MiB" % (self._most >> 20))
        return data


class _TarInfo(tarfile.TarInfo):
    """An entry of a tar file; refuses descriptions that would fill the memory."""

    # tarfile's entry point for subclasses; it gives the size before anything of it is read.
    def _proc_member(self, archive: tarfile.TarFile) -> tarfile.TarInfo:
        if self.type in _DESCRIPTIONS and self.size > _MAX_DESCRIPTION_BYTES:
            raise BadArchive("holds a file name or attributes of %d bytes" % self.size)
        return super()._proc_member(archive)  # pyright: ignore[reportAttributeAccessIssue]


def _content(archive: tarfile.TarFile, info: tarfile.TarInfo) -> bytes:
    file = archive.extractfile(info)
    return b"" if file is None else file.read(most_bytes(info.name) + 1)


def _tar_entries(stream: Any, name: str, bounds: ArchiveBounds) -> Iterator[tuple[Any, ...]]:
    if name.endswith((".gz", ".tgz")):
        stream = gzip.GzipFile(fileobj=stream)
    elif name.endswith((".bz2", ".tbz2", ".tbz")):
        stream = bz2.BZ2File(stream)
    with tarfile.open(fileobj=_Limited(stream, bounds.bytes), mode="r|", tarinfo=_TarInfo) as archive:
        for info in archive:
            if info.isdir():
                continue
            problem = ""
            if info.issym() or info.islnk():
                problem = "holds a link, %s to %s; links are not followed" % (info.name, info.linkname)
            elif not info.isreg():
                problem = "holds %s, which is not a file" % info.name
            yield info.name, problem, lambda info=info: _content(archive, info)
