"""Output files: complete or absent, of two writers one, and never through a link."""

import errno
import os
import threading
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.logs import LogWriteError
from selfmodel.logs.files import create_file, make_folder, replace_file, write_new


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
    names = [write_new(path, data) for data in (b"1", b"2", b"3")]

    assert [name.name for name in names] == ["a.html", "a-2.html", "a-3.html"]
    assert [name.read_bytes() for name in names] == [b"1", b"2", b"3"]
    with pytest.raises(InputError, match=r"a\.html exists"), create_file(path) as file:
        file.write(b"new")
    assert sorted(tmp_path.iterdir()) == sorted(names)


@pytest.mark.parametrize("name", ["results.csv", "results.csv.part"])
def test_no_link_that_lies_in_the_way_is_followed(tmp_path: Path, name: str):
    precious = tmp_path / "precious"
    precious.write_text("of the user")
    (tmp_path / name).symlink_to(precious)

    replace_file(tmp_path / "results.csv", b"new")

    assert precious.read_text() == "of the user"
    assert (tmp_path / "results.csv").read_bytes() == b"new"
    assert not (tmp_path / "results.csv").is_symlink()


def test_two_writers_of_one_result_do_not_mix(tmp_path: Path):
    path = tmp_path / "result.json"
    whole = [bytes([letter]) * 10**6 for letter in b"abcd"]
    writers = [threading.Thread(target=replace_file, args=(path, data)) for data in whole]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()

    assert path.read_bytes() in whole
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("write", [replace_file, write_new])
def test_of_a_full_disk_nothing_is_left_but_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: object
):
    (tmp_path / "a.html").write_bytes(b"old")
    refuse(monkeypatch, os, "fsync", errno.ENOSPC)

    with pytest.raises(LogWriteError, match="the disk is full"):
        write(tmp_path / "a.html", b"new")

    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def test_a_new_file_that_fails_leaves_nothing(tmp_path: Path):
    def interrupted() -> None:
        with create_file(tmp_path / "a.csv") as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()

    assert list(tmp_path.iterdir()) == []
    with (
        pytest.raises(InputError, match="there is no folder"),
        create_file(tmp_path / "no" / "a.csv"),
    ):
        pass


def test_the_names_of_new_folders_are_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    synced: list[Path] = []
    monkeypatch.setattr("selfmodel.logs.files.sync_folder", synced.append)
    make_folder(tmp_path / "run" / "trials")

    assert (tmp_path / "run" / "trials").is_dir()
    assert set(synced) == {tmp_path, tmp_path / "run"}
