"""Files of a bag: a folder, one file or split files."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from selfmodel.errors import InputError
from selfmodel.files import check_regular, read_file
from selfmodel.logs.errors import CorruptError

METADATA = "metadata.yaml"
EXPECTED = "give a bag's folder, or its .mcap, .db3 or .bag"


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Context manager that converts errors of the system about a bag's files.

    Args:
        path: Path of the bag.

    Raises:
        InputError: A file of the bag cannot be read.
    """
    try:
        yield
    except OSError as failure:
        if failure.filename is None or not _within(failure.filename, path):
            raise
        raise InputError(
            f"{path}: expected a bag that can be read, got: {failure.strerror}"
        ) from failure


def _within(filename: object, path: Path) -> bool:
    return Path(str(filename)).absolute().is_relative_to(path.absolute())


def bag_files(path: Path) -> list[Path]:
    """Returns the storage files of a bag, in order.

    Args:
        path: Folder of a bag, with or without ``metadata.yaml``, or one of its files.

    Raises:
        LogError: A file is missing, or the list of the files is damaged.
        InputError: The bag does not exist, or the folder has none.
    """
    if not path.is_dir():
        check_regular(path, "a bag")
        return [path]
    if not (path / METADATA).exists():
        found = [name for name in path.iterdir() if _STORAGE.search(name.name) and name.is_file()]
        if not found:
            raise InputError(f"{path}: expected a bag, got a folder without one: {EXPECTED}")
        return sorted(found, key=_natural)
    files = [path / name for name in _listed(path / METADATA)]
    if missing := [file.name for file in files if not file.is_file()]:
        raise CorruptError(
            path,
            f"its {METADATA} lists missing files: {', '.join(missing)}",
            advice=f"add it, or remove {METADATA} to read the files that are there",
        )
    return files


_STORAGE = re.compile(r"\.(mcap|db3)(\.zstd)?$")


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key that orders ``bag_2`` before ``bag_10``."""
    return [(int(part) if part.isdecimal() else 0, part) for part in re.split(r"(\d+)", path.name)]


def _listed(path: Path) -> list[str]:
    """Files in ``metadata.yaml``, without the folder that older versions prepend."""
    try:
        # The base loader returns every value as text.
        data: Any = YAML(typ="base", pure=True).load(read_file(path, METADATA, 2**20))
        listed = data["rosbag2_bagfile_information"]["relative_file_paths"]
    except (YAMLError, ValueError, KeyError, TypeError, RecursionError) as failure:
        reason = re.sub(r"\s+", " ", str(failure))
        raise CorruptError(
            path, f"it cannot be read: {reason}", advice="remove it to do without it"
        ) from failure
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise CorruptError(path, "it lists no files", advice="remove it to do without it")
    return [PurePath(name).name for name in listed]
