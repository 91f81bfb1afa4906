"""Files that a cut never leaves half-written."""

import errno
import hashlib
import io
import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from alsph.folder import durable
from alsph.folder.durable import _Overlay, growing, recover, replacing, viewing
from hypothesis import given, settings
from hypothesis import strategies as st

OPERATIONS = st.lists(st.tuples(st.booleans(), st.integers(0, 20000), st.binary(max_size=9000)), max_size=20)


@settings(deadline=None)
@given(content=st.binary(max_size=12000), operations=OPERATIONS, cut=st.integers(0, 20000) | st.none())
def test_an_overlay_is_a_file_that_changes_at_the_end_only(tmp_path_factory, content, operations, cut):
    path = tmp_path_factory.getbasetemp() / "overlay"
    path.write_bytes(content)
    expected = io.BytesIO(content)
    with _Overlay(path) as overlay:
        for is_write, place, data in operations:
            place = min(place, len(expected.getvalue()))
            for file in (overlay, expected):
                file.seek(place)
            if is_write:
                assert overlay.write(data) == expected.write(data)
            else:
                found = bytearray(len(data))
                count = overlay.readinto(found)
                assert bytes(found[:count]) == expected.read(len(data))
            assert overlay.seek(0, os.SEEK_END) == expected.seek(0, os.SEEK_END)
        assert path.read_bytes() == content
        if cut is not None:
            cut = min(cut, len(expected.getvalue()))
            assert overlay.truncate(cut) == expected.truncate(cut)
        overlay.commit()
    assert path.read_bytes() == expected.getvalue()
    assert not list(path.parent.glob(".overlay*"))


def grow(path, value):
    """Add a row to a table, so that pages in the midst of the file change and new ones come."""
    with growing(path) as file:
        if "table" not in file:
            file.create_dataset("table", (0, 700), float, maxshape=(None, 700), chunks=(1, 700), compression="gzip")
        file["table"].resize(len(file["table"]) + 1, axis=0)
        file["table"][-1] = np.random.default_rng(value).random(700)
        file.attrs["rows"] = len(file["table"])


def rows(path):
    with viewing(path) as file:
        assert file.attrs["rows"] == len(file["table"])
        return [row.tobytes() for row in file["table"]]


def killed_at(event, action):
    """Do something in a child that kills itself at a given event that touches the disk; return whether it did."""
    child = os.fork()
    if child == 0:
        left = event

        def counted(function):
            def call(*arguments, **options):
                nonlocal left
                left -= 1
                if left < 0:
                    os.kill(os.getpid(), signal.SIGKILL)
                return function(*arguments, **options)

            return call

        os.fsync = counted(os.fsync)
        struct.unpack_from = counted(struct.unpack_from)  # once before every page
        Path.replace, Path.unlink = counted(Path.replace), counted(Path.unlink)
        action()
        os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


def test_a_process_killed_at_any_moment_leaves_the_old_file_or_the_new_one(tmp_path):
    path = tmp_path / "table.h5"
    for value in range(40):
        grow(path, value)
    old = rows(path)
    content = path.read_bytes()
    grow(path, 40)
    new = rows(path)
    seen, event = set(), 0
    while True:
        path.write_bytes(content)
        if not killed_at(event, lambda: grow(path, 40)):
            break
        found = rows(path)
        assert found in (old, new)
        recover(path)
        assert rows(path) == found
        seen.add(len(found))
        # The next change starts from there.
        grow(path, 50)
        assert rows(path)[:-1] == found
        event += 1
    assert event > 8 and seen == {40, 41}


def test_an_exception_leaves_the_old_file(tmp_path):
    path = tmp_path / "table.h5"
    grow(path, 0)
    content = path.read_bytes()
    with pytest.raises(ZeroDivisionError), growing(path) as file:
        file["more"] = np.ones(10000)
        raise ZeroDivisionError
    assert path.read_bytes() == content
    with pytest.raises(ZeroDivisionError), replacing(path) as temporary:
        temporary.write_text("half")
        raise ZeroDivisionError
    assert path.read_bytes() == content
    assert [entry.name for entry in tmp_path.iterdir()] == ["table.h5"]


def journal_of(body):
    return durable.MAGIC + hashlib.sha256(body).digest() + body


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_an_exception_in_the_midst_of_a_write_leaves_the_old_file(tmp_path, monkeypatch, error):
    """The HDF5 library does not bear one: it would go on with half of its state, or end the process when it closes."""
    path = tmp_path / "table.h5"
    for value in range(3):
        grow(path, value)
    content, touched, event = path.read_bytes(), _Overlay._touched, 0
    while True:
        left = event

        def fail(self, start, end):
            nonlocal left
            left -= 1
            if left == -1:
                raise error
            return touched(self, start, end)

        with monkeypatch.context() as context:
            context.setattr(_Overlay, "_touched", fail)
            try:
                grow(path, 3)
            except error:
                assert path.read_bytes() == content
            else:
                break
        event += 1
    assert event > 8 and len(rows(path)) == 4


def test_a_disk_that_cannot_be_read_is_not_a_damaged_file(tmp_path, monkeypatch):
    path = tmp_path / "table.h5"
    grow(path, 0)

    def fail(self, start, end):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(_Overlay, "_touched", fail)
    with pytest.raises(OSError, match="Input/output error") as caught:
        grow(path, 1)
    assert caught.value.errno == errno.EIO


def test_a_process_ends_well_after_a_file_that_hdf5_cannot_close(tmp_path):
    """The library would flush what it has of the file after Python's end, and crash."""
    path = tmp_path / "table.h5"
    grow(path, 0)
    script = """
import sys
from pathlib import Path
from alsph.folder.durable import _Overlay, growing

def fail(self, start, end):
    raise MemoryError

_Overlay._touched = fail
try:
    with growing(Path(sys.argv[1])):
        pass
except MemoryError:
    print("raised")
"""
    done = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "raised\n"), done.stderr


def test_a_change_that_shrinks_is_completed(tmp_path, monkeypatch):
    path = tmp_path / "table.h5"
    for value in range(40):
        grow(path, value)
    monkeypatch.setattr(Path, "unlink", lambda *_, **__: None)  # as if it were killed just before
    with growing(path) as file:
        file["table"].resize(3, axis=0)
        file.attrs["rows"] = 3
    monkeypatch.undo()
    journal, content = durable._journal(path), path.read_bytes()
    assert journal.exists() and durable._pending(path)
    found = rows(path)
    assert len(found) == 3
    recover(path)
    assert path.read_bytes() == content and not journal.exists()


@pytest.mark.parametrize(
    "journal",
    [
        b"",
        b"nonsense",
        durable.MAGIC + bytes(100),
        journal_of(b"123"),
        journal_of(struct.pack("<Q", 2**60)),
        journal_of(struct.pack("<QQQ", 0, 2**60, 4) + b"page"),
    ],
)
def test_a_journal_that_is_none_is_dropped(tmp_path, journal):
    path = tmp_path / "table.h5"
    grow(path, 0)
    content = path.read_bytes()
    durable._journal(path).write_bytes(journal)
    recover(path)
    assert path.read_bytes() == content
    assert not durable._journal(path).exists()


def test_a_full_disk_leaves_the_old_file(tmp_path):
    """A limit of the size of files makes writes fail as a full disk does."""
    path = tmp_path / "table.h5"
    for value in range(40):
        grow(path, value)
    old, size = rows(path), path.stat().st_size
    for room in (0, 100, 3000):
        child = os.fork()
        if child == 0:
            import resource

            resource.setrlimit(resource.RLIMIT_FSIZE, (size + room, resource.RLIM_INFINITY))
            try:
                grow(path, 40)
            except OSError:
                os._exit(7)
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
        assert rows(path) == old
