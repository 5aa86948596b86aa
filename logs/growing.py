"""Steps of a trial log while it is written, or of a finished one, in order."""

from itertools import chain
from pathlib import Path

from mcap.exceptions import InvalidMagic

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.logs import errors, reader, records
from selfmodel.logs.files import partial_path
from selfmodel.logs.growing_file import GrowingFile
from selfmodel.logs.log_file import FAILURES, Contents, Gatherer
from selfmodel.logs.messages import COMMANDS, Part, Topic, topics
from selfmodel.logs.robots import describe_difference
from selfmodel.logs.writer import FLUSH_STEPS
from selfmodel.trials.signals import SIGNALS, Names
from selfmodel.trials.trajectory import Sample, StepTiming

_NAMING = ("/joint_states", "/sensors", COMMANDS)
"""Topics whose messages have the names of the signals."""


class GrowingLog:
    """A trial log that is read as far as it is written.

    Of what is read, the checksums of chunks, the layout of messages and the names are verified; the
    digests and the result of a finished log are not: ``read_log`` does that.

    Args:
        path: A log, ``NAME.mcap``, or one that is being written, ``NAME.mcap.part``, which is also
            read where NAME.mcap does not exist yet.
        names: Names that its signals must have.

    Attributes:
        path: The file that is read.
        steps: Number of steps that were read.
        start: Time stamp of the first step, ns.
        most_new: Number of new steps that a look may find.

    Raises:
        InputError: There is no such file; or, of ``new_steps``, the log is of another robot.
        LogError: Of ``new_steps``: the log is damaged, or no trial log.
    """

    most_new = 2 * FLUSH_STEPS  # a trial is written in parts

    def __init__(self, path: Path, names: Names) -> None:
        self.path = path if path.exists() else partial_path(path)
        if not self.path.is_file():
            raise InputError(
                f"{path}: expected a trial log, finished or being written; a recording of a robot "
                f"needs --mapping"
            )
        self._file = GrowingFile(self.path)
        self._names, self.steps, self.start = names, 0, 0
        self._contents = Contents(self.path)
        self._gatherer = Gatherer(self._contents, (records.HIDDEN,))
        self._topics: tuple[Topic, ...] = ()

    @property
    def has_ended(self) -> bool:
        """Whether the log is finished, and read to its end."""
        return self._file.has_ended

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def new_steps(self) -> list[Sample]:
        """Returns the steps that were completed since the last call."""
        try:
            for record in chain.from_iterable(self._file.parts()):
                self._gatherer.add(record)
        except InvalidMagic:
            what = "this is not an MCAP file"
            raise errors.NotMcapError(self.path, what, advice=errors.ANOTHER) from None
        except FAILURES as failure:
            what = f"the file is damaged: {failure or type(failure).__name__}"
            advice = errors.salvage_it(self.path)
            raise self._contents.error(what, errors.CorruptError, advice) from failure
        found = self._contents.topics
        if found and not self._topics:
            reader.read_record(self._contents)  # raises LogError for a file that is no trial log
        if not self._topics and all(one in found and found[one].payloads for one in _NAMING):
            self._topics = self._checked_topics()
        held = [found[one.name].payloads if one.name in found else [] for one in self._topics]
        count, rows = min(map(len, held), default=0), dict[Part, FloatArray]()
        if not count:
            return []
        for topic, payloads in zip(self._topics, held, strict=True):
            with self._contents.mismatch(f"on {topic.name}"):
                rows |= topic.unpack(topic.template.decode(payloads[:count])[1])
        for messages in found.values():
            del messages.payloads[:count], messages.times[:count]
        self.steps += count
        return [self._sample(rows, k, self.steps - count + k) for k in range(count)]

    def _checked_topics(self) -> tuple[Topic, ...]:
        record = reader.read_record(self._contents)
        names = reader.read_names(self._contents, record)
        if names != self._names:
            difference = describe_difference(self._names, names)
            raise InputError(f"{self.path} is of another robot than the healthy logs: {difference}")
        self.start = reader.first_stamp(self._contents)
        self._period, timed = record.control_timestep, record.format == records.TIMED_FORMAT
        driven = reader.names_on(self._contents, COMMANDS)
        return topics(names, record.root, timed=timed, driven=driven)

    def _sample(self, rows: dict[Part, FloatArray], row: int, step: int) -> Sample:
        values = {signal: rows[signal][row] for signal in SIGNALS}
        moment = None
        if "timing" in rows:
            elapsed, *marks = rows["timing"][row].tolist()
            moment = StepTiming(elapsed, *(mark != 0 for mark in marks))  # unknown counts as late
        return Sample(step * self._period, values, moment)
