"""Task of the child process that reads a bag: files, decompression, decoding into arrays."""

import os
from pathlib import Path

from selfmodel.files import file_digest
from selfmodel.isolation import Message
from selfmodel.logs.recordings.rosbag.answer import answer
from selfmodel.logs.recordings.rosbag.files import bag_files, explained
from selfmodel.logs.recordings.rosbag.gathering import Gathering
from selfmodel.logs.recordings.rosbag.storage import read_storage
from selfmodel.logs.recordings.series import Source


def read(request: Message) -> Message:
    """Reads a bag.

    Args:
        request: ``path`` of the bag, ``folder`` that a relative path begins in, and ``wanted``
            topics.

    Returns:
        Topics, sources and decoded messages; see ``selfmodel.logs.recordings.rosbag.answer``.

    Raises:
        LogError: The bag is damaged.
        InputError: The bag cannot be read.
    """
    os.chdir(request.header["folder"])
    path = Path(request.header["path"])
    gathering = Gathering(path, request.header["wanted"])
    with explained(path):
        names = bag_files(path)
        for name in names:
            for item in read_storage(name):
                gathering.add(item)
        sources = [Source(name.name, file_digest(name)) for name in names]
    return answer(gathering.topics().values(), sources, gathering.decoded())
