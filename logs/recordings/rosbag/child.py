"""Task of the child process that reads a bag: files, decompression, decoding into arrays."""

import os
from pathlib import Path

from selfmodel.files import file_digest
from selfmodel.logs.recordings.rosbag.answer import answer
from selfmodel.logs.recordings.rosbag.files import bag_files, explained
from selfmodel.logs.recordings.rosbag.gathering import Gathering
from selfmodel.logs.recordings.rosbag.storage import read_storage
from selfmodel.logs.recordings.series import Source
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.message import Message


def read(request: Message, budget: Budget, scratch: Path) -> Message:
    """Reads a bag.

    Args:
        request: ``path`` of the bag, ``folder`` that a relative path begins in, and ``wanted``
            topics.
        budget: Limits of the answer.
        scratch: Folder for decompressed files.

    Returns:
        Topics, sources and decoded messages; see ``selfmodel.logs.recordings.rosbag.answer``.

    Raises:
        LogError: The bag is damaged.
        BudgetError: The answer would be too large.
        InputError: The bag cannot be read.
    """
    os.chdir(request.facts["folder"])
    path = Path(request.facts["path"])
    gathering = Gathering(path, request.facts["wanted"], budget)
    with explained(path):
        names = bag_files(path)
        for name in names:
            for item in read_storage(name, scratch, budget):
                gathering.add(item)
        sources = [Source(name.name, file_digest(name)) for name in names]
    return answer(gathering.topics().values(), sources, gathering.decoded())
