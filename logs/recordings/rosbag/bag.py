"""Bag as arrays: its topics, its files' digests, and the messages of some topics.

A child process reads the files, whose content may be hostile; see
``selfmodel.logs.recordings.rosbag.child``.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from selfmodel.isolation import RECORDING_SECONDS, Message, run_isolated
from selfmodel.logs.errors import (
    CorruptError,
    IncompleteError,
    NotMcapError,
    TruncatedError,
    UnsupportedError,
)
from selfmodel.logs.recordings.rosbag.answer import parse_answer
from selfmodel.logs.recordings.series import Series, Source, Topic

_ERRORS = (CorruptError, IncompleteError, NotMcapError, TruncatedError, UnsupportedError)


@dataclass(frozen=True, eq=False)
class Bag:
    """Recording whose files have been read and checked once.

    Attributes:
        path: Path from the user.
        topics: Topics by name.
        sources: Files of the bag, in order.
        series: Messages of the wanted topics with a supported type, by topic.
    """

    path: Path
    topics: Mapping[str, Topic]
    sources: tuple[Source, ...]
    series: Mapping[str, Series]


def read_bag(path: Path, wanted: Collection[str]) -> Bag:
    """Returns a bag, after a check of all its files.

    Args:
        path: Folder of a rosbag2 bag, with or without ``metadata.yaml``, or one of its files; or
            a ROS 1 bag.
        wanted: Names of the topics whose messages are decoded.

    Raises:
        LogError: A file is damaged, missing, or not a recording.
        InputError: The bag does not exist, or cannot be read.
    """
    request = {"path": str(path), "folder": str(Path.cwd()), "wanted": sorted(wanted)}
    found = run_isolated(
        "selfmodel.logs.recordings.rosbag.child:read",
        Message(request),
        what=str(path),
        seconds=RECORDING_SECONDS,
        errors=_ERRORS,
    )
    return Bag(path, *parse_answer(found.header, found.buffers))
