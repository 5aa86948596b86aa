"""Reads the files of an MJCF from its own folder, or from memory."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from posixpath import basename, normpath
from typing import Protocol

from selfmodel.errors import InputError
from selfmodel.files import read_file


class Files(Protocol):
    """Source of the files that an MJCF names, by their paths relative to the MJCF."""

    def has(self, name: str) -> bool:
        """Returns whether the file exists."""
        ...

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns the content of a file.

        Args:
            name: Path of the file relative to the MJCF.
            what: Description of the file in an error message.
            limit: Largest size, in bytes.

        Raises:
            InputError: The file is missing, outside the folder, or larger than the limit.
        """
        ...


@dataclass(frozen=True)
class Folder:
    """The files in a folder and its subfolders."""

    path: Path

    def has(self, name: str) -> bool:
        """Returns whether the file exists."""
        return self._inside(name) and (self.path / name).is_file()

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns the content of a file; see ``Files.read``."""
        if not self._inside(name):
            raise InputError(
                f"the MJCF names {what} outside its own folder, {name!r}: put the file into "
                f"{self.path}, and name it relative to that folder"
            )
        return read_file(self.path / name, what, limit)

    def _inside(self, name: str) -> bool:
        try:
            return (self.path / name).resolve().is_relative_to(self.path.resolve())
        except (OSError, ValueError):  # a loop of links; a path with a zero byte
            return False


@dataclass(frozen=True)
class InMemory:
    """Files in memory, such as those of a dm_control domain."""

    files: Mapping[str, bytes | str]

    def has(self, name: str) -> bool:
        """Returns whether the file exists."""
        return self._content(name) is not None

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns the content of a file; see ``Files.read``."""
        content = self._content(name)
        if content is None:
            raise InputError(
                f"the MJCF names {what}, which is not given: pass the content of the file"
            )
        data = content.encode() if isinstance(content, str) else content
        if len(data) > limit:
            raise InputError(f"{name}: expected {what} of at most {limit} bytes, got more")
        return data

    def _content(self, name: str) -> bytes | str | None:
        plain = {normpath(path): content for path, content in self.files.items()}
        # MuJoCo also accepts a file in memory by its name without the folder.
        return plain.get(normpath(name), plain.get(basename(name)))
