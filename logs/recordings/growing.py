"""Steps of a robot in a bag while it is recorded, as an import of the finished bag has them.

Its files are read as far as they are written. Messages become tracks, of which the newest seconds
are kept; the control steps that are old enough are resampled from these, each once, in order.
"""

from collections.abc import Callable, Sequence, Set as AbstractSet
from contextlib import closing
from itertools import count
from pathlib import Path

import numpy as np
from mcap import records as mcap

from selfmodel.errors import InputError
from selfmodel.logs.growing_file import GrowingFile
from selfmodel.logs.recordings.bags import bag_files, explained, files_in, in_order
from selfmodel.logs.recordings.importer import MAX_STEPS
from selfmodel.logs.recordings.mapping_file import RecordingMapping, check_recording, check_robot
from selfmodel.logs.recordings.recording import IntArray, Recording
from selfmodel.logs.recordings.resample import NOTHING, ControlSteps, Track
from selfmodel.logs.recordings.runs import restarts
from selfmodel.logs.recordings.signals import Frame, signals_of, start_frame, wraps_around
from selfmodel.logs.recordings.topics import McapTopics, Topic
from selfmodel.logs.recordings.tracks import Tracks, clocks_of, extent, required, tracks_of
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample, Trajectory, samples_of

LAG = 500_000_000
"""Age of a step at which it is resampled, ns, by the newest message of any topic but the commands:
what comes later is missing. It is 25 messages at 50 Hz, by which a usual period is known."""

KEPT = 2_000_000_000
"""Time before the next step of which tracks are kept, ns."""

FEWEST = 12
"""Steps that are resampled at once, at least: fewer take nearly as long."""

MAX_READ = 100_000_000_000
"""Time of a recording that is read at once, ns."""

PATIENCE = 5_000_000_000
"""Time of a recording after which topics without messages are named, ns."""

_FOLLOWED = (
    "--follow is for MCAP: record with `ros2 bag record -s mcap`, or watch the finished recording "
    "without --follow"
)

_ARRIVALS = 1000
"""Messages of a topic before the new ones in which a clock that restarts is looked for."""


class GrowingBag:
    """A bag of MCAP files that is read as far as it is recorded, in this process.

    Its steps are those of ``import_recording`` but for what that knows of the whole recording: the
    median period of a topic is that of the time kept, ``KEPT`` before and ``LAG`` after a step; a
    message that comes later than ``LAG`` is missing; and the steps go on, not observed, when a
    topic ends before the others.

    Args:
        path: A folder of rosbag2, whose files of MCAP follow each other, or one such file.
        mapping: Mapping of its topics.
        robot: The robot, whose control time step is that of the steps.
        note: Gets warnings, one sentence each.

    Attributes:
        path: The bag.
        steps: Number of steps that were returned.
        has_ended: Whether the bag is finished, or its mapping's duration over, and all steps were
            returned.
        most_new: Number of new steps that a look at the bag may find, as often as it is written.

    Raises:
        InputError: There is no such bag, the mapping is not one of a bag of the robot, or, of
            ``new_steps``, the bag is damaged or does not fit the mapping, or its clock restarts.
    """

    def __init__(
        self, path: Path, mapping: RecordingMapping, robot: Robot, note: Callable[[str], None]
    ) -> None:
        check_robot(mapping, robot.anatomy)
        if mapping.trial.time is not None:
            raise mapping.error(("time",), f"[time] is for tables: {_FOLLOWED}")
        self.path, self.steps, self.has_ended, self.most_new = path, 0, False, 0
        self._mapping, self._robot, self._note = mapping, robot, note
        self._said: set[str] = set()
        self._columns = {name: sorted(some) for name, some in mapping.topics.items()}
        self._topics = {name: Topic() for name in self._columns}
        self._begin_file(bag_files(path)[0])
        places = mapping.places.values()
        self._timing = {place.topic for place in places if place.role != ("commands",)}
        self._is_complete, self._places = False, count()
        self._logged = 0  # newest log time, ns
        self._heard: dict[str, int] = {}  # first log times by topic of the mapping, ns
        self._arrived: dict[str, IntArray] = {}  # newest times by topic, in the order they came
        self._tracks: Tracks = dict.fromkeys(mapping.places, NOTHING)
        self._origin: int | None = None
        self._frame: Frame | None = None

    @property
    def start(self) -> int:
        """Time stamp of the first step, ns; 0 before it is known."""
        return self._origin or 0

    def close(self) -> None:
        """Closes the file that is read."""
        self._file.close()

    def new_steps(self) -> list[Sample]:
        """Returns the steps that became old enough since the last call."""
        self._read()
        self._merge()
        if self._origin is None:
            self._origin = self._begun()
        found = [] if self._origin is None else self._resampled(self._origin)
        if self._arrived:
            since = self._next() - KEPT
            self._tracks = {key: track.since(since) for key, track in self._tracks.items()}
        return found

    def _resampled(self, origin: int) -> list[Sample]:
        """Returns the steps that are old enough, if they are enough."""
        timestep, duration = self._robot.control_timestep, self._mapping.trial.duration
        due = self._due(origin)
        if due - self.steps > MAX_STEPS:
            raise InputError(
                f"{self.path}: its clock jumps forward by {(due - self.steps) * timestep:.0f} s "
                f"at {self.steps * timestep:.3f} s: start the watch again, with a recording that "
                f"begins after that"
            )
        self.has_ended = self._is_complete
        if duration is not None and due >= round(duration / timestep):
            due, self.has_ended = round(duration / timestep), True
        if due - self.steps < (1 if self.has_ended else FEWEST):
            return []
        steps = ControlSteps(origin, timestep, np.arange(self.steps, due))
        if not self.steps:
            self._frame = start_frame(self._mapping, self._tracks, steps)
        self.steps = due
        trial, names = self._mapping.trial, self._robot.anatomy.names
        signals = signals_of(trial, self._tracks, self._robot, steps, self._frame)
        rows = Trajectory(names, steps.seconds, {signal: signals[signal] for signal in SIGNALS})
        return list(samples_of(rows))

    # ------------------------------------------------------------ files

    def _begin_file(self, path: Path) -> None:
        if path.suffix != ".mcap":
            raise InputError(
                f"{path}: expected an .mcap, without compression of files: {_FOLLOWED}"
            )
        self._file, self._announced = GrowingFile(path), McapTopics()

    def _read(self) -> None:
        """Reads what was recorded since the last call, at most ``MAX_READ``."""
        begin = self._logged
        while True:
            path, following, is_last = self._file.path, *self._following()
            with explained(path):
                for part in self._file.parts():
                    self._add(part)
                    if begin and self._logged - begin > MAX_READ:
                        return
            if following is None:
                self._is_complete = self._file.has_ended and is_last
                return
            if not self._file.has_ended:
                self._note(self._announced.cut(path))
            self._file.close()
            self._begin_file(following)

    def _following(self) -> tuple[Path | None, bool]:
        """Returns the next file, if something was recorded in it, and whether there will be none.

        A recorder creates a file before it closes the one before, and the list of files before it
        closes the last one.
        """
        if not self.path.is_dir():
            return None, True
        is_listed, current = (self.path / "metadata.yaml").exists(), in_order(self._file.path)
        later = [path for path in files_in(self.path) if in_order(path) > current]
        if later and _has_messages(later[0]):
            return later[0], False
        return None, is_listed and not later

    def _add(self, part: Sequence[mcap.McapRecord]) -> None:
        before = self._logged
        for record in part:
            if (item := self._announced.stored(record)) is None:
                continue
            topic = self._topics.setdefault(item.topic, Topic())
            topic.add(item, next(self._places), self._columns.get(item.topic))
            if item.data is not None:
                self._logged, before = item.time, before or item.time
                if item.topic in self._columns:
                    self._heard.setdefault(item.topic, item.time)
        burst = (self._logged - before) / 1e9 / self._robot.control_timestep
        self.most_new = max(self.most_new, 2 * FEWEST, round(2 * burst))

    # ------------------------------------------------------------ tracks

    def _merge(self) -> None:
        """Adds the messages that were read to the tracks, and drops old ones."""
        series = {name: self._topics[name].taken() for name in self._columns}
        recording = Recording(series, {})
        clocks = clocks_of(self._mapping, recording)
        for topic, clock in clocks.items():
            if len(new := clock.times[clock.usable]):
                self._arrived[topic] = self._in_order(topic, new)
        for (quantity, part), later in tracks_of(self._mapping, recording, clocks).items():
            if self.steps and len(later) and later.times[0] < self._next():
                topic = self._mapping.places[quantity, part].topic
                self._say(f"{topic}: messages come more than {LAG / 1e9:g} s late, and are missing")
            track = self._tracks[quantity, part].joined(later)
            if quantity == "joint_positions" and wraps_around(self._robot, part):
                track = Track(track.times, np.unwrap(track.values, axis=0))
            self._tracks[quantity, part] = track

    def _next(self) -> int:
        """Returns the time of the next step, or as long as none is known, of what is old, ns."""
        if self._origin is None:
            return self._newest(self._arrived.keys()) - LAG
        return self._origin + round(self.steps * self._robot.control_timestep * 1e9)

    def _in_order(self, topic: str, new: IntArray) -> IntArray:
        """Returns the newest times of a topic, in the order in which they came."""
        times = np.append(self._arrived.get(topic, new[:0])[-_ARRIVALS:], new)
        if any(restarts(times)):
            raise InputError(
                f"{self.path}: its clock restarts after {self.steps} steps, on {topic}: start the "
                f"watch again with a recording that begins there, or watch this one when it is "
                f"finished, without --follow, with --run"
            )
        return times

    def _newest(self, topics: AbstractSet[str]) -> int:
        """Returns the newest time on topics, but for that of a single message."""
        return max(int(self._arrived[topic][-2:].min()) for topic in topics & self._arrived.keys())

    def _begun(self) -> int | None:
        """Returns the time of the first step, ns, once what decides it is known."""
        is_complete, heard = self._is_complete, self._heard
        missing = self._columns.keys() - heard.keys()
        if not missing:
            needed = required(self._tracks).items()
            missing = {self._mapping.places[key].topic for key, track in needed if not len(track)}
        if missing and self._logged - min(heard.values(), default=self._logged) > PATIENCE:
            self._say(f"{self.path}: no numbers yet on {', '.join(sorted(missing))}")
        # A message may have a part of the names.
        is_heard = len(heard) == len(self._columns) and self._logged >= max(heard.values()) + LAG
        if is_complete or is_heard:
            series = {name: topic.series() for name, topic in self._topics.items() if topic.types}
            check_recording(self._mapping, Recording(series, {}))
        if not is_complete and (missing or not is_heard):
            return None
        first, _ = extent(self._mapping, self._tracks, self._robot.control_timestep)
        if not is_complete and self._newest(self._timing) - LAG < first:
            return None
        return first + round(self._mapping.trial.start * 1e9)

    def _due(self, origin: int) -> int:
        """Returns the number of steps that are old enough; in a finished bag, all are."""
        timestep, newest = self._robot.control_timestep, self._newest(self._timing) - LAG
        if self._is_complete:
            newest = max(newest, extent(self._mapping, self._tracks, timestep)[1])
        return int((newest - origin + 0.5) // (timestep * 1e9)) + 1

    def _say(self, sentence: str) -> None:
        if sentence not in self._said:
            self._said.add(sentence)
            self._note(sentence)


def _has_messages(path: Path) -> bool:
    """Returns whether something was recorded in a file, or nothing is to come."""
    if path.suffix != ".mcap":
        return True
    with explained(path), closing(GrowingFile(path)) as file:
        kinds = mcap.Message | mcap.DataEnd
        return any(isinstance(record, kinds) for part in file.parts() for record in part)
