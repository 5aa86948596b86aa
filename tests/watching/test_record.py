"""The folder of a watch: messages that ROS 2 reads, and a trial log of what came before."""

import multiprocessing
import struct
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

import selfmodel
from selfmodel.errors import InputError
from selfmodel.logs import read_log
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample, StepTiming
from selfmodel.watching import Finding, Rated, part_statuses, record
from selfmodel.watching.record import BLACK_BOX, FINDINGS, WatchRecord
from tests.watching.conftest import stream

START = 1_700_000_000_000_000_000
WATCHING = Finding(0.0, "watching")
CHANGED = Finding(1.25, "changed", "", 1.0, 0.5, 1.25, ("back_left_knee",))


@pytest.fixture(scope="module")
def steps(quadruped: Robot) -> list[Sample]:
    return stream(quadruped, "intact", 400)


def explained(robot: Robot) -> Finding:
    jam = selfmodel.parse_hypothesis("jam:back_left_knee=0.3", robot)
    return replace(CHANGED, time=2.5, status="explained", remaining=(Rated(jam, 0.1),))


def recorded(
    folder: Path, robot: Robot, steps: Iterable[Sample], findings: list[Finding]
) -> WatchRecord:
    """The record of some steps, and of findings at their times."""
    with WatchRecord(folder, robot) as written:
        for step in steps:
            found = [one for one in findings if one.time == step.time]
            written.add(step, found, START)
    return written


def messages(path: Path) -> list[tuple[int, Any]]:
    """Time in ns and array of each message, as rosbags reads it."""
    with AnyReader([path]) as bag:
        return [
            (stamp, bag.deserialize(data, connection.msgtype))
            for connection, stamp, data in bag.messages()
        ]


def unfinished(path: Path) -> list[Any]:
    """Each message of a file that has no end yet, as mcap and its support of ROS 2 read it."""
    found = []
    with path.open("rb") as file:
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        read = reader.iter_decoded_messages(log_time_order=False)
        try:
            found.extend(one.decoded_message for one in read)
        except (EndOfFile, struct.error):
            assert path.suffix == ".part"
    return found


def test_a_finding_is_said_at_once_and_an_unchanged_state_once_a_second(
    tmp_path: Path, quadruped: Robot, steps: list[Sample]
):
    findings = [WATCHING, CHANGED, explained(quadruped)]
    recorded(tmp_path / "w", quadruped, steps, findings)
    said = messages(tmp_path / "w" / FINDINGS)

    assert [stamp - START for stamp, _ in said] == [
        *(0, 1_000_000_000, 1_250_000_000, 2_250_000_000, 2_500_000_000, 3_500_000_000)
    ]
    for (stamp, array), finding in zip(said, [one for one in findings for _ in "12"], strict=True):
        assert array.header.stamp.sec * 10**9 + array.header.stamp.nanosec == stamp
        for state, expected in zip(array.status, part_statuses(quadruped, finding), strict=True):
            assert state.level == expected.level
            assert (state.name, state.message) == (expected.name, expected.message)
            assert state.hardware_id == "quadruped"
            assert {one.key: one.value for one in state.values} == dict(expected.values)


def test_findings_can_be_read_while_they_are_written(
    tmp_path: Path, quadruped: Robot, steps: list[Sample]
):
    with WatchRecord(tmp_path, quadruped) as written:
        assert unfinished(tmp_path / f"{FINDINGS}.part") == []
        for count, finding in enumerate((WATCHING, CHANGED), start=1):
            written.add(steps[0], [finding])
            said = unfinished(tmp_path / f"{FINDINGS}.part")
            assert len(said) == count
        assert said[-1].status[0].message == CHANGED.words
    assert len(unfinished(tmp_path / FINDINGS)) == len(messages(tmp_path / FINDINGS)) == 2


def test_the_black_box_has_the_last_steps_to_the_bit_with_their_timing_and_gaps(
    tmp_path: Path, quadruped: Robot, steps: list[Sample], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(record, "KEPT", 3.0)
    timed = [
        replace(one, moment=StepTiming(one.time, k == 200, False)) for k, one in enumerate(steps)
    ]
    for k, signal in ((105, "commands"), (250, "joint_positions")):
        lacking = {**timed[k].values, signal: np.full(8, np.nan)}
        timed[k] = replace(timed[k], values=lacking)
    timed[100] = replace(timed[100], values={**timed[100].values, "commands": np.full(8, np.nan)})
    written = recorded(tmp_path, quadruped, timed, [WATCHING, explained(quadruped)])
    log = read_log(tmp_path / BLACK_BOX)

    assert written.note.endswith("black-box.mcap: 299 steps from t = 1.01 s on")
    assert (log.status, log.trial.plan.stage, log.trial.trajectory.steps) == (
        *("finished", "single", 299),
    )
    assert log.timing.late.nonzero()[0].tolist() == [99]
    assert log.timing.elapsed.tolist() == [one.time for one in timed[101:]]
    for signal in SIGNALS:
        kept = np.stack([one.values[signal] for one in timed[101:]])
        assert log.trial.trajectory[signal].tobytes() == kept.tobytes()


@pytest.mark.parametrize(
    ("last", "has_box"),
    [
        ([], True),
        ([Finding(2.0, "stale", "no step")], True),
        ([Finding(2.0, "watching")], False),
        ([Finding(2.0, "not judged", "why")], False),
    ],
)
def test_there_is_a_black_box_of_a_change_that_was_no_false_alarm_even_if_it_is_interrupted(
    tmp_path: Path, quadruped: Robot, steps: list[Sample], last: list[Finding], *, has_box: bool
):
    def interrupted() -> Iterator[Sample]:
        yield from steps[:220]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        recorded(tmp_path, quadruped, interrupted(), [CHANGED, *last])
    assert (tmp_path / FINDINGS).exists()
    assert (tmp_path / BLACK_BOX).exists() == has_box
    assert not list(tmp_path.glob("*.part"))


def test_there_is_a_black_box_of_a_watch_that_ended_and_began_anew(
    tmp_path: Path, quadruped: Robot, steps: list[Sample]
):
    """The times of the new watch begin at 0, the stamps are those of the steps."""
    with WatchRecord(tmp_path, quadruped) as written:
        for step in steps:
            found = [one for one in (CHANGED, explained(quadruped)) if one.time == step.time]
            written.add(step, found if step.time != 3.0 else [WATCHING], START)

    stamps = [stamp for stamp, _ in messages(tmp_path / FINDINGS)]
    assert stamps == sorted(stamps)
    assert (tmp_path / BLACK_BOX).exists()


def test_steps_without_any_command_are_no_black_box(
    tmp_path: Path, quadruped: Robot, steps: list[Sample]
):
    unknown = {"commands": np.full(len(quadruped.anatomy.motors), np.nan)}
    blind = [replace(one, values={**one.values, **unknown}) for one in steps]
    written = recorded(tmp_path, quadruped, blind, [CHANGED, explained(quadruped)])

    assert "the last steps have no commands" in written.note
    assert not (tmp_path / BLACK_BOX).exists()


def test_without_a_finding_there_is_no_file_and_another_record_is_kept(
    tmp_path: Path, quadruped: Robot, steps: list[Sample]
):
    recorded(tmp_path, quadruped, steps[:10], [])
    assert not list(tmp_path.iterdir())
    recorded(tmp_path, quadruped, steps, [WATCHING, CHANGED])
    for name in (BLACK_BOX, FINDINGS):
        before = (tmp_path / name).read_bytes()
        with pytest.raises(InputError, match=f"{name} exists"):
            WatchRecord(tmp_path, quadruped)
        assert (tmp_path / name).read_bytes() == before
        (tmp_path / name).unlink()


def killed(folder: str, began: Any) -> None:  # noqa: ANN401  # an event of multiprocessing
    """Records a change over and over, until the process is killed."""
    robot = selfmodel.load_robot("quadruped")
    steps = stream(robot, "intact", 400)
    began.set()
    for number in range(1000):
        recorded(Path(folder) / str(number), robot, steps, [WATCHING, CHANGED, explained(robot)])


def kills(folder: Path, delays: list[float]) -> Iterator[list[Path]]:
    """The folders of the records of processes that were killed some time after they began."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    for number, delay in enumerate(delays):
        began = context.Event()
        own = folder / str(number)
        process = context.Process(target=killed, args=(str(own), began))
        process.start()
        assert began.wait(60)
        time.sleep(delay)
        process.kill()
        process.join()
        yield sorted(own.iterdir(), key=lambda one: int(one.name))


@pytest.mark.process
def test_a_kill_leaves_findings_that_open_and_no_half_of_a_black_box(tmp_path: Path):
    delays = np.random.default_rng(7).uniform(0.0, 0.4, 6).tolist()
    for folders in kills(tmp_path, delays):
        for folder in folders:
            for findings in folder.glob(f"{FINDINGS}*"):
                said = unfinished(findings)
                assert findings.suffix == ".part" or len(said) == 6
                assert {len(one.status) for one in said} <= {17}
            if (folder / BLACK_BOX).exists():
                assert read_log(folder / BLACK_BOX).trial.trajectory.steps == 400
