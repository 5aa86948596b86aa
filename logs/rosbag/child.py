"""Task of the child process that reads a bag: files, decompression, decoding into arrays."""

import os
from pathlib import Path

from selfmodel.logs.rosbag.files import bag_files, explained
from selfmodel.logs.rosbag.gathering import Gathering
from selfmodel.logs.rosbag.series import series_bytes
from selfmodel.logs.rosbag.storage import read_storage, sha256
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.message import Message


def read(request: Message, budget: Budget, scratch: Path) -> Message:
    """Reads a bag; see ``selfmodel.logs.rosbag.bag.read_bag`` for both messages.

    Args:
        request: ``path`` of the bag, ``folder`` that a relative path begins in, and ``wanted``
            topics.
        budget: Limits of the answer.
        scratch: Folder for decompressed files.

    Returns:
        Topics, sources, and names and reasons of each series; a blob per series has its arrays.
    """
    os.chdir(request.facts["folder"])
    path = Path(request.facts["path"])
    gathering = Gathering(path, request.facts["wanted"], budget)
    with explained(path):
        names = bag_files(path)
        for name in names:
            for item in read_storage(name, scratch, budget):
                gathering.add(item)
        sources = [(name.name, sha256(name)) for name in names]
    topics, series = gathering.topics().values(), gathering.series()
    return Message(
        {
            "topics": [(topic.name, topic.type, topic.encoding, topic.count) for topic in topics],
            "sources": sources,
            "columns": {found.topic.name: list(found.columns) for found in series},
            "refused": {found.topic.name: found.refused for found in series},
        },
        {found.topic.name: series_bytes(found) for found in series},
    )
