import errno
import os
from pathlib import Path

import pytest

from selfmodel.logs.errors import LogWriteError
from selfmodel.logs.files import write_new


def refuse(monkeypatch: pytest.MonkeyPatch, owner: object, name: str, number: int) -> None:
    """Makes a function of the operating system fail."""

    def refused(*_arguments: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(owner, name, refused)


@pytest.fixture(
    params=[None, errno.EPERM, errno.ENOTSUP, errno.ENOSYS, errno.EACCES, errno.EMLINK, errno.EXDEV]
)
def _file_system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file system with hard links, and those that refuse them, by their errors."""
    if request.param is not None:
        refuse(monkeypatch, os, "link", request.param)


@pytest.mark.usefixtures("_file_system")
def test_a_new_file_has_its_name_and_replaces_no_file_that_has_it(tmp_path: Path):
    path = tmp_path / "a.html"

    assert [write_new(path, data) for data in (b"1", b"2", b"3")] == [
        path,
        tmp_path / "a-2.html",
        tmp_path / "a-3.html",
    ]

    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == {
        "a.html": b"1",
        "a-2.html": b"2",
        "a-3.html": b"3",
    }


def test_the_unfinished_file_of_another_program_is_kept(tmp_path: Path):
    (tmp_path / "a.html.part").write_bytes(b"of another")

    assert write_new(tmp_path / "a.html", b"new") == tmp_path / "a.html"

    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.html", "a.html.part"]
    assert (tmp_path / "a.html.part").read_bytes() == b"of another"


def test_of_a_full_disk_nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    refuse(monkeypatch, os, "fsync", errno.ENOSPC)

    with pytest.raises(LogWriteError, match="the disk is full"):
        write_new(tmp_path / "a.html", b"new")

    assert list(tmp_path.iterdir()) == []


def test_a_finished_file_that_cannot_get_its_name_is_kept_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    refuse(monkeypatch, os, "link", errno.EPERM)
    refuse(monkeypatch, Path, "replace", errno.EIO)

    with pytest.raises(LogWriteError, match=r"the finished file is .*a\.html\.part: rename it"):
        write_new(tmp_path / "a.html", b"new")

    assert [one.name for one in tmp_path.iterdir()] == ["a.html.part"]
    assert (tmp_path / "a.html.part").read_bytes() == b"new"
