"""Reads the files that a robot is described in, from one folder and nowhere else."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from posixpath import basename, normpath
from typing import Protocol

from selfmodel.errors import InputError
from selfmodel.files import read_file


class Files(Protocol):
    """Where the files that a model names are looked for, by their paths from the model."""

    def has(self, name: str) -> bool:
        """Returns whether there is such a file."""
        ...

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns all of a file.

        Raises:
            InputError: There is none, it is out of bounds, or larger than the limit.
        """
        ...


@dataclass(frozen=True)
class Folder:
    """The files in a folder and below it."""

    path: Path

    def has(self, name: str) -> bool:
        """Returns whether there is such a file."""
        return self._inside(name) and (self.path / name).is_file()

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns all of a file; see ``Files.read``."""
        if not self._inside(name):
            raise InputError(
                f"it names {what} outside its own folder, {name!r}: put the file into {self.path}, "
                f"and name it from there"
            )
        return read_file(self.path / name, what, limit)

    def _inside(self, name: str) -> bool:
        try:
            return (self.path / name).resolve().is_relative_to(self.path.resolve())
        except (OSError, ValueError):  # a loop of links, a zero byte
            return False


@dataclass(frozen=True)
class InMemory:
    """Files that are in memory already, such as those of a dm_control domain."""

    files: Mapping[str, bytes | str]

    def has(self, name: str) -> bool:
        """Returns whether there is such a file."""
        return self._found(name) is not None

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns all of a file; see ``Files.read``."""
        found = self._found(name)
        if found is None:
            raise InputError(f"it names {what}, which was not given with it: give its content")
        data = found.encode() if isinstance(found, str) else found
        if len(data) > limit:
            raise InputError(f"{name}: expected {what} of at most {limit} bytes, got more")
        return data

    def _found(self, name: str) -> bytes | str | None:
        plain = {normpath(path): content for path, content in self.files.items()}
        # MuJoCo does without the folder where a file in memory has none.
        return plain.get(normpath(name), plain.get(basename(name)))
