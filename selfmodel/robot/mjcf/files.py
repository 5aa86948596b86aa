"""Reads the files of an MJCF or a URDF from the folders of the robot, or from memory."""

from collections.abc import Mapping
from dataclasses import dataclass
from os.path import realpath
from pathlib import Path, PurePosixPath
from posixpath import basename, normpath
from typing import Protocol

from selfmodel.errors import InputError
from selfmodel.files import read_file

_MODEL_FOLDERS = ("mjcf", "mjx", "mujoco", "scene", "scenes", "urdf", "xml", "xmls")
"""Names of folders in which a robot's package has its models."""

_ASSET_FOLDERS = ("assets", "meshes", "textures")
"""Names of folders in which a robot's package has its meshes and textures."""

_MAX_NAME = 4096
"""Largest path of a file, characters; Linux has the same limit."""

_REMEDY = "name a folder that contains the file, with --set assets=DIR"


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
    """The files of a robot on disk.

    A file is read at its path from the folder of the MJCF, if that is within ``root`` or
    ``assets``. Otherwise its path is searched in ``assets``, first whole and then without its first
    folders: ``../../menagerie/go1/assets/trunk.stl`` is found as ``go1/assets/trunk.stl``,
    ``assets/trunk.stl`` or ``trunk.stl``. A link counts as the file that it leads to.

    Attributes:
        path: Folder of the MJCF.
        root: Folder around all files of the robot; see ``root_around``.
        assets: Further folder with files that the MJCF names; None for none.
    """

    path: Path
    root: Path
    assets: Path | None = None

    def has(self, name: str) -> bool:
        """Returns whether the file exists."""
        return self._found(name) is not None

    def read(self, name: str, what: str, limit: int) -> bytes:
        """Returns the content of a file; see ``Files.read``."""
        found = self._found(name)
        if found is not None:
            return read_file(found, what, limit)
        if self._may_read(self.path / name):
            raise InputError(
                f"the MJCF names {what}, which is no file in {self.path}: put the file there, or "
                f"{_REMEDY}"
            )
        raise InputError(
            f"the MJCF names {what} outside its own folder, {name!r}: put the file into "
            f"{self.root}, or {_REMEDY}"
        )

    def _found(self, name: str) -> Path | None:
        if len(name) > _MAX_NAME:
            return None
        places = [self.path / name]
        if self.assets is not None:
            parts = [part for part in PurePosixPath(name).parts if part not in ("..", "/", "//")]
            places += [self.assets.joinpath(*parts[start:]) for start in range(len(parts))]
        return next(filter(self._is_file, places), None)

    def _is_file(self, place: Path) -> bool:
        try:
            return self._may_read(place) and place.is_file()
        except OSError:  # a name that is too long for the file system
            return False

    def _may_read(self, place: Path) -> bool:
        folders = [folder for folder in (self.root, self.assets) if folder is not None]
        try:
            return any(_real(place).is_relative_to(_real(folder)) for folder in folders)
        except ValueError:  # a path with a zero byte
            return False


def _real(path: Path) -> Path:
    """Returns where a path leads to; a loop of links leads to itself (``resolve`` raises)."""
    return Path(realpath(path))


def robot_folder(folder: Path, assets: str = "") -> Folder:
    """Returns the files of a robot whose MJCF or URDF is in a folder.

    Args:
        folder: Folder of the MJCF or URDF.
        assets: Further folder with files of the robot; "" for none.

    Raises:
        InputError: The further folder does not exist.
    """
    if assets and not _is_folder(assets):
        raise InputError(f"assets needs a folder with files of the robot, got {assets!r}")
    return Folder(folder, root_around(folder), Path(assets) if assets else None)


def _is_folder(path: str) -> bool:
    try:
        return Path(path).is_dir()
    except OSError:  # a name that is too long for the file system
        return False


def root_around(folder: Path) -> Path:
    """Returns the folder around the files of a robot whose MJCF or URDF is in a folder.

    It is the folder above if the layout is that of ROS and MuJoCo Menagerie: the folder has a name
    such as ``mjcf``, or there is a folder such as ``meshes`` beside it. It is never the home folder
    or a folder around that.
    """
    above = _real(folder).parent
    usual = _real(folder).name in _MODEL_FOLDERS or any(
        (above / name).is_dir() for name in _ASSET_FOLDERS
    )
    return above if usual and not is_around_home(above) else folder


def is_around_home(folder: Path) -> bool:
    """Returns whether a folder is the home folder, or contains the home folder."""
    try:
        home = Path.home()
    except RuntimeError:  # the user has no home folder
        return folder == folder.parent
    return folder == folder.parent or _real(home).is_relative_to(folder)


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
