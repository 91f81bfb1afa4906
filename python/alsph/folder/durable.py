"""Files that nothing leaves half-written, be it a killed process, a full disk or a power cut.

A file is either replaced as a whole (:func:`replacing`) or, if it is an HDF5 file, grown in one stroke
(:func:`growing`): what is new is written behind its end, and the few pages in its midst that must change are first
written to a journal beside it, from which a change that was cut is completed.
"""

import atexit
import ctypes
import functools
import hashlib
import io
import os
import re
import stat
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

import h5py

from alsph.errors import RunFolderError

PAGE = 4096
MAGIC = b"alsph journal 1\n"


@contextmanager
def replacing(path: Path, keep: Path | None = None) -> Iterator[Path]:
    """Give a temporary path and, once its file is safe on the disk, rename it to `path`; `keep` gets what was there."""
    temporary = path.with_name(f".{path.name}.new")
    try:
        temporary.unlink(missing_ok=True)
        yield temporary
        flush(temporary)
        if keep and path.exists():
            path.replace(keep)
        temporary.replace(path)
        flush(path.parent)
    except OSError as error:
        if error.filename is not None and os.fspath(error.filename) == str(temporary):
            error.filename = str(path)  # the name that whoever asked for it knows
        raise
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def is_plain(path: Path, *kinds: Callable[[int], bool]) -> bool:
    """Whether what has that path is of one of those kinds, and no link to it, or there is nothing.

    It is looked at once: a file that another process has just put into its place was never a special one.
    """
    try:
        mode = path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return True
    return any(kind(mode) for kind in kinds)


def check_target(path: Path) -> None:
    """Refuse to write a file through a link or into a device, which may lie anywhere.

    Raises
    ------
    RunFolderError
        If there is one with that path.
    """
    if not is_plain(path, stat.S_ISREG):
        raise RunFolderError(f"{path}: a link or a special file, and alsph does not write through it; remove it first")


def check_folder(path: Path) -> None:
    """Refuse a folder that is a link.

    Raises
    ------
    RunFolderError
        If it is one.
    """
    if path.is_symlink():
        raise RunFolderError(f"{path}: a link, and alsph does not write through it; remove it, or give another folder")


def write_text(path: Path, text: str) -> None:
    """Write a text file, in place of what was there and never through a link."""
    check_target(path)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def flush(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    if os.name != "posix" and path.is_dir():
        return
    descriptor = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def growing(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file to be changed or, if there is none, made: all of the change takes place, or nothing of it.

    The HDF5 library works in memory: it does not bear a disk that fails.
    """
    recover(path)
    if not path.exists():
        content = io.BytesIO()
        with h5py.File(content, "w") as file:
            yield file
        with replacing(path) as temporary:
            temporary.write_bytes(content.getbuffer())
        return
    with _Overlay(path) as overlay:
        with _opened(overlay, "r+") as file:
            yield file
        overlay.commit()


@contextmanager
def viewing(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file to be read, as it will be once a change that was cut is completed; nothing is written."""
    body = _pending(path)
    if not body:
        # Without a lock, so that a run that writes the file is not disturbed.
        with h5py.File(path, "r", locking=False) as file:
            yield file
        return
    with _Overlay(path, "rb") as overlay:
        for offset, page in _pages(body):
            overlay.seek(offset)
            overlay.write(page)
        with _opened(overlay, "r") as file:
            yield file


@contextmanager
def _opened(overlay: "_Overlay", mode: str) -> Iterator[h5py.File]:
    """Open what an overlay shows as an HDF5 file; raises what reading or writing it raised."""
    try:
        with h5py.File(overlay, mode) as file:
            yield file
    except BaseException as error:
        overlay.failure = overlay.failure or error
    if overlay.failure:
        atexit.unregister(_close_library)
        atexit.register(_close_library)
        raise overlay.failure


def _close_library() -> None:
    """End the HDF5 library before Python ends: a damaged file that it could not close would crash the process after."""
    maps = Path("/proc/self/maps")  # elsewhere than on Linux the process may crash once all is done
    names = re.findall(r"/.*/libhdf5[-.][^/\n]*$", maps.read_text() if maps.exists() else "", re.MULTILINE)
    for name in set(names):
        ctypes.CDLL(name).H5close()


def recover(path: Path) -> None:
    """Complete a change of a file that was cut in the midst of it."""
    if body := _pending(path):
        _apply(path, body)
    _journal(path).unlink(missing_ok=True)


def _journal(path: Path) -> Path:
    return path.with_name(f".{path.name}.journal")


def _pending(path: Path) -> bytes:
    """Return what the journal of a file holds; nothing if there is none, or none that is whole and of the file."""
    try:
        content, end = _journal(path).read_bytes(), path.stat().st_size
    except FileNotFoundError:
        return b""
    head = len(MAGIC) + 32
    body = content[head:]
    # A journal is complete, being renamed when it is on the disk, before the first page changes.
    if not content.startswith(MAGIC) or hashlib.sha256(body).digest() != content[len(MAGIC) : head]:
        return b""
    with suppress(struct.error):  # a journal that others made
        (size,) = struct.unpack_from("<Q", body)
        pages = [(offset, len(page)) for offset, page in _pages(body)]
        aligned = all(offset % PAGE == 0 and 0 < length <= PAGE for offset, length in pages)
        if size <= end and aligned and all(offset + length <= size for offset, length in pages):
            return body
    return b""


def _pages(body: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the offsets of the pages in a journal, and the pages."""
    place = 8
    while place < len(body):
        offset, length = struct.unpack_from("<QQ", body, place)
        place += 16
        yield offset, body[place : place + length]
        place += length


def _apply(path: Path, body: bytes) -> None:
    """Write the pages in a journal into their file, and cut it to its new size; to do so twice does no harm."""
    (size,) = struct.unpack_from("<Q", body)
    with path.open("r+b") as file:
        for offset, page in _pages(body):
            file.seek(offset)
            file.write(page)
        file.truncate(size)
        file.flush()
        os.fsync(file.fileno())


def _held(method: Callable[..., int]) -> Callable[..., int]:
    """Have a method note what it raises, to be raised when the file is closed: the HDF5 library does not bear it."""

    @functools.wraps(method)
    def call(self: "_Overlay", *arguments: Any) -> int:
        try:
            return method(self, *arguments)
        except BaseException as error:
            self.failure = self.failure or error
            return 0

    return call


class _Overlay(io.RawIOBase):
    """A file whose changes are held in memory until :meth:`commit`; `failure` is what it raised, if anything."""

    def __init__(self, path: Path, mode: Literal["rb", "r+b"] = "r+b") -> None:
        super().__init__()
        self._path = path
        self._file = path.open(mode, buffering=0)
        self._old = os.fstat(self._file.fileno()).st_size
        self._pages: dict[int, bytearray] = {}
        self._tail = bytearray()
        self._end = self._old
        self._place = 0
        self.failure: BaseException | None = None

    @_held
    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._end}[whence]
        self._place = base + offset
        return self._place

    def tell(self) -> int:
        return self._place

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        view[:] = bytes(len(view))  # for what the file does not hold, or a disk does not give
        return self._read_into(view)

    @_held
    def _read_into(self, view: memoryview) -> int:
        start, end = self._place, max(min(self._place + len(view), self._end), self._place)
        self._file.seek(start)
        read = 0
        while start + read < min(end, self._old) and (part := self._file.readinto(view[read : self._old - start])):
            read += part
        for offset, first, last in self._touched(start, end):
            if offset in self._pages:
                view[first - start : last - start] = self._pages[offset][first - offset : last - offset]
        if end > self._old:
            first = max(start, self._old)
            view[first - start : end - start] = self._tail[first - self._old : end - self._old]
        self._place = end
        return end - start

    @_held
    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        start, end = self._place, self._place + len(view)
        if end > self._end:
            self.truncate(end)
        for offset, first, last in self._touched(start, end):
            self._page(offset)[first - offset : last - offset] = view[first - start : last - start]
        if end > self._old:
            first = max(start, self._old)
            self._tail[first - self._old : end - self._old] = view[first - start :]
        self._place = end
        return len(view)

    def _touched(self, start: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Yield the offset of each page that lay in the file and meets `start` to `end`, and where they overlap."""
        end = min(end, self._old)
        for offset in range(start - start % PAGE, end, PAGE):
            first, last = max(start, offset), min(end, offset + PAGE)
            if first < last:
                yield offset, first, last

    def _page(self, offset: int) -> bytearray:
        if offset not in self._pages:
            self._file.seek(offset)
            self._pages[offset] = bytearray(self._file.read(min(PAGE, self._old - offset)))
        return self._pages[offset]

    @_held
    def truncate(self, size: int | None = None) -> int:
        self._end = self._place if size is None else size
        length = max(self._end - self._old, 0)
        self._tail = self._tail[:length].ljust(length, b"\0")
        return self._end

    def commit(self) -> None:
        """Let all that was written take place.

        Raises
        ------
        OSError
            If the disk fails; the file is as it was, or becomes so by :func:`recover`.
        """
        try:
            self._file.seek(self._old)
            written = 0
            while written < len(self._tail):
                written += self._file.write(memoryview(self._tail)[written:]) or 0
            os.fsync(self._file.fileno())
            body = struct.pack("<Q", self._end)
            for offset, page in sorted(self._pages.items()):
                if kept := page[: max(self._end - offset, 0)]:
                    body += struct.pack("<QQ", offset, len(kept)) + kept
            with replacing(_journal(self._path)) as temporary:
                temporary.write_bytes(MAGIC + hashlib.sha256(body).digest() + body)
        except OSError:
            _journal(self._path).unlink(missing_ok=True)
            self._file.truncate(self._old)
            raise
        _apply(self._path, body)
        _journal(self._path).unlink()

    def close(self) -> None:
        self._file.close()
        super().close()


def mark(path: Path) -> str:
    """Return what changes with a file or folder, the time first; nothing for what is missing or a link."""
    try:
        found = os.lstat(path)
    except OSError:
        return ""
    plain = stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)
    return f"{found.st_mtime_ns:020d}.{found.st_size}.{found.st_ino}" if plain else ""
