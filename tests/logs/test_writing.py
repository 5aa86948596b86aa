"""A log holds what a trial was, to the bit, and keeps it whatever ends the trial."""

import dataclasses
import errno
import io
import json
import os
from collections.abc import Callable, Generator, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError, TrialError
from selfmodel.logs import LogError, LogWriteError, TruncatedError, log_file, read_log, read_truth
from selfmodel.logs.log_file import read_contents, read_undamaged
from selfmodel.logs.messages import TIMING, topics
from selfmodel.logs.physical_trial import MIN_STEPS, TrialRunner, run_trial
from selfmodel.logs.records import MAX_TEXT, RESULT, TRIAL, TrialHeader
from selfmodel.logs.salvage import salvage
from selfmodel.logs.writer import FLUSH_STEPS, TrialWriter, write_trial
from selfmodel.physical.safety import HangError
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample, Trajectory, collect
from selfmodel.trials.trial import TrialPlan
from tests.logs.conftest import STEPS, MadeUpRobot, full, made_up, plan_of, timed

ANYTHING = st.floats(allow_nan=True, allow_infinity=True, width=64)


def write(
    path: Path, robot: Robot, samples: Iterator[Sample], steps: int = STEPS, **header: object
) -> Path:
    return write_trial(
        path, robot, plan_of(robot, steps), samples, TrialHeader(Settings(), **header)
    )


def stopping(robot: Robot, at: int, error: BaseException, *, clock: bool) -> Iterator[Sample]:
    samples = made_up(robot, STEPS)
    for k, sample in enumerate(timed(samples) if clock else samples):
        if k == at:
            raise error
        yield sample


def steps_kept(part: Path, robot: Robot) -> int:
    """Number of complete steps in an unfinished file, which must be the true ones."""
    with pytest.raises(TruncatedError, match="selfmodel logs salvage"):
        read_log(part)
    contents = read_undamaged(part)[0]
    assert set(contents.attachments) == {"model.xml", "controller.npz", "settings.json"}
    for topic in topics(robot.anatomy.names, robot.root):
        messages = contents.topics[topic.name]
        rows = topic.unpack(topic.template.decode(messages.payloads)[1])
        for k, sample in enumerate(made_up(robot, len(messages.payloads))):
            for name in set(rows) & set(sample.values):
                assert rows[name][k].tobytes() == sample.values[name].tobytes()
    return len(messages.payloads)


def assert_same_bits(trajectory: Trajectory, expected: Trajectory):
    assert trajectory.names == expected.names
    assert trajectory.time.tobytes() == expected.time.tobytes()
    assert set(trajectory.signals) == set(SIGNALS)
    for name in SIGNALS:
        assert trajectory[name].tobytes() == expected[name].tobytes(), name


@settings(max_examples=12, deadline=None)
@given(data=st.data(), steps=st.integers(1, 60))
def test_every_signal_comes_back_to_the_bit_whatever_its_value(
    biped: Robot, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, steps: int
):
    names = biped.anatomy.names
    series = {
        name: data.draw(arrays(np.float64, (steps, names.width(name)), elements=ANYTHING))
        for name in SIGNALS
    }
    samples = [
        Sample(k * biped.control_timestep, {name: series[name][k] for name in SIGNALS})
        for k in range(steps)
    ]
    with np.errstate(invalid="ignore"):  # infinity minus infinity, a displacement of nowhere
        path = write(tmp_path_factory.mktemp("logs") / "a.mcap", biped, samples, steps)
        assert_same_bits(read_log(path).trial.trajectory, collect(names, samples))


def test_a_simulated_trial_of_every_robot_comes_back_to_the_bit(robot: Robot, tmp_path: Path):
    samples = list(SimulatedRobot(robot).run(plan_of(robot, 101).controller, 101))
    path = write(tmp_path / "a.mcap", robot, samples, 101)
    assert_same_bits(read_log(path).trial.trajectory, collect(robot.anatomy.names, samples))


def test_a_log_has_its_plan_and_the_same_trial_the_same_bytes(
    log: Path, biped: Robot, plan: TrialPlan
):
    read = read_log(log)
    assert (read.trial.plan, read.trial.robot, read.trial.path) == (plan, "biped", str(log))
    assert (read.mjcf, read.control_timestep) == (biped.mjcf, biped.control_timestep)
    assert (read.settings, read.status, read.reason) == (Settings(), "finished", "")
    assert read.timing is read.trial.trajectory.late is read.acceleration is None
    assert set(read.software) == {"selfmodel", "mujoco", "numpy", "python", "mcap"}
    way = [float(sample.values["base_position"][0]) for sample in made_up(biped, STEPS)]
    assert read.trial.displacement == way[-1] - way[0]
    contents = read_contents(log)
    assert contents.metadata[TRIAL]["format"] == "1"
    assert set(contents.metadata[RESULT]) == {"status", "steps", "displacement"}
    again = write(log.with_name("b.mcap"), biped, made_up(biped, STEPS), hidden="intact")
    assert again.read_bytes() == log.read_bytes()


def test_the_truth_is_read_only_by_who_asks_for_it(log: Path, biped: Robot, tmp_path: Path):
    logs = {"intact": read_log(log)}
    for hidden in (None, "neuron:0"):
        (tmp_path / str(hidden)).mkdir()
        path = tmp_path / str(hidden) / "trial.mcap"
        write(path, biped, made_up(biped, STEPS), hidden=hidden)
        logs[hidden] = read_log(path)
        assert read_truth(path) == hidden
    assert read_truth(log) == "intact"
    assert len({json.dumps(visible(read), sort_keys=True) for read in logs.values()}) == 1


def visible(value: object) -> object:
    """Everything that can be reached from a value, but the folder of its file, as JSON."""
    if isinstance(value, np.ndarray):
        return [value.shape, value.tobytes().hex()]
    if hasattr(value, "items"):
        return {key: visible(item) for key, item in value.items()}
    if hasattr(value, "__dict__"):
        return {key: visible(item) for key, item in vars(value).items() if key != "path"}
    return [visible(item) for item in value] if isinstance(value, tuple) else repr(value)


def test_a_clock_comes_back_to_the_bit(biped: Robot, tmp_path: Path):
    samples = timed(made_up(biped, STEPS))
    read = read_log(write(tmp_path / "a.mcap", biped, samples, timed=True))
    moments = [sample.moment for sample in timed(made_up(biped, STEPS))]

    assert read.timing is not None
    assert read.timing.elapsed.tolist() == [moment.elapsed for moment in moments]
    assert read.timing.late.tolist() == [moment.late for moment in moments]
    assert read.timing.missing.tolist() == [moment.missing for moment in moments]
    assert np.array_equal(read.trial.trajectory.late, read.timing.late)


@pytest.mark.parametrize(("column", "value"), [(0, 0.0), (0, np.inf), (1, 0.5), (2, -1.0)], ids=str)
def test_a_clock_that_cannot_be_is_refused(
    biped: Robot, tmp_path: Path, column: int, value: float, monkeypatch: pytest.MonkeyPatch
):
    def decode(template: object, payloads: list[bytes]) -> tuple[np.ndarray, np.ndarray]:
        stamps, values = original(template, payloads)
        if template is TIMING.template:
            values = values.copy()
            values[60, column] = value
        return stamps, values

    path = write(tmp_path / "a.mcap", biped, timed(made_up(biped, STEPS)), timed=True)
    original = type(TIMING.template).decode
    monkeypatch.setattr(type(TIMING.template), "decode", decode)
    with pytest.raises(LogError, match="on /timing: expected"):
        read_log(path)


@pytest.mark.parametrize(
    ("spoil", "match"),
    [
        (lambda s: Sample(s.time + 1e-12, s.values), r"step 1 of 3 is due at 0\.01 s"),
        (lambda s: Sample(s.time, {}), "must have sensors of shape .* got nothing"),
        (lambda s: Sample(s.time, {**s.values, "commands": np.zeros(1)}), r"got \(1,\)"),
        (lambda s: next(timed([s])), "step 1 has a moment"),
    ],
)
def test_a_sample_that_does_not_fit_is_refused(
    biped: Robot, tmp_path: Path, spoil: Callable[[Sample], Sample], match: str
):
    first, second = made_up(biped, 2)
    with pytest.raises(InputError, match=match):
        write(tmp_path / "a.mcap", biped, [first, spoil(second)], 3)
    assert not (tmp_path / "a.mcap").exists()


def test_a_controller_of_another_robot_and_a_name_of_no_file_are_refused(
    biped: Robot, quadruped: Robot, tmp_path: Path
):
    header = TrialHeader(Settings())
    with pytest.raises(InputError, match="expected a controller for quadruped"):
        TrialWriter(tmp_path / "a.mcap", quadruped, plan_of(biped, 3), header)
    for name in ("", "../evil", "a.b", "ä", "x" * 101, "a\n"):
        with pytest.raises(InputError, match="letters, digits and '-'"):
            TrialWriter(tmp_path / "a.mcap", biped, plan_of(biped, 3, name), header)


@pytest.mark.parametrize("name", ["a.mcap", "a.mcap.part"])
def test_an_existing_file_is_neither_overwritten_nor_run_for(
    biped: Robot, tmp_path: Path, name: str
):
    (tmp_path / name).write_text("precious")
    samples = stopping(biped, 0, AssertionError("the robot was run"), clock=False)
    with pytest.raises(InputError, match=rf"{name} exists, and is not overwritten"):
        write(tmp_path / "a.mcap", biped, samples)
    assert [file.name for file in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "precious"


def test_a_folder_in_place_of_a_file_is_said_to_be_one(biped: Robot, tmp_path: Path):
    (tmp_path / "a.mcap").mkdir()
    samples = stopping(biped, 0, AssertionError("the robot was run"), clock=False)
    with pytest.raises(InputError, match=r"a\.mcap is a folder: give the name of a new file"):
        write(tmp_path / "a.mcap", biped, samples)


def test_a_file_that_is_created_meanwhile_is_not_overwritten(biped: Robot, tmp_path: Path):
    path = tmp_path / "a.mcap"

    def intruding() -> Iterator[Sample]:
        for k, sample in enumerate(made_up(biped, STEPS)):
            if k == 5:
                path.write_text("precious")
            yield sample
        raise AssertionError("more samples than planned were read")

    with pytest.raises(InputError, match=r"the finished file is .*a\.mcap\.part"):
        write(path, biped, intruding())
    assert path.read_text() == "precious"
    assert read_log(tmp_path / "a.mcap.part").status == "finished"


@pytest.mark.parametrize(
    ("at", "error"), [(1, RuntimeError("it fell")), (50, KeyboardInterrupt()), (77, ValueError())]
)
def test_what_ends_a_trial_passes_on_and_every_step_until_then_stays(
    biped: Robot, tmp_path: Path, at: int, error: BaseException
):
    with pytest.raises(type(error)) as caught:
        write(tmp_path / "a.mcap", biped, stopping(biped, at, error, clock=False))
    assert caught.value is error
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
    assert steps_kept(tmp_path / "a.mcap.part", biped) == at


def test_a_file_lacks_at_most_the_steps_of_one_flush_at_any_moment(biped: Robot, tmp_path: Path):
    """What is in the file is what a kill leaves: ``tests/end_to_end`` kills the command."""
    kept = []

    def samples() -> Iterator[Sample]:
        for k, sample in enumerate(made_up(biped, STEPS)):
            if k % 23 == 22:
                kept.append((k, steps_kept(tmp_path / "a.mcap.part", biped)))
            yield sample

    write(tmp_path / "a.mcap", biped, samples())
    assert len(kept) == STEPS // 23
    assert all(taken - FLUSH_STEPS < steps <= taken for taken, steps in kept)


class FallError(Exception):
    """What a robot may end with."""


@pytest.mark.parametrize(
    ("at", "error", "reason"),
    [
        (1, FallError("the leg\n came  off"), "FallError: the leg came off"),
        (51, KeyboardInterrupt(), "KeyboardInterrupt"),
        (51, FallError("x" * 9999), f"FallError: {'x' * (MAX_TEXT - 11)}"),
        (1, FallError("/dev/\udcff"), r"FallError: /dev/\udcff"),
    ],
    ids=["error", "Ctrl-C", "long", "no text"],
)
def test_a_trial_with_a_clock_that_is_stopped_is_a_whole_log(
    biped: Robot, tmp_path: Path, at: int, error: BaseException, reason: str
):
    with pytest.raises(type(error)) as caught:
        write(tmp_path / "a.mcap", biped, stopping(biped, at, error, clock=True), timed=True)
    log = read_log(tmp_path / "a.mcap")

    assert caught.value is error
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    assert (log.status, log.trial.trajectory.steps, log.reason) == ("stopped", at, reason)
    with pytest.raises(InputError, match="the trial in it is stopped"):
        salvage(tmp_path / "a.mcap", tmp_path / "b.mcap")


def test_a_trial_that_stops_before_its_first_step_has_no_log(biped: Robot, tmp_path: Path):
    with pytest.raises(FallError):
        write(tmp_path / "a.mcap", biped, stopping(biped, 0, FallError(), clock=True), timed=True)
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_steps_are_written_leaves_what_can_be_salvaged(
    biped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    def samples() -> Iterator[Sample]:
        for k, sample in enumerate(timed(made_up(biped, STEPS))):
            if k == 50:  # the next one is written with the 49 before
                monkeypatch.setattr(log_file.LogFile, "messages", interrupt)
            yield sample

    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "a.mcap", biped, samples(), timed=True)
    monkeypatch.undo()
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap.part"]
    assert salvage(tmp_path / "a.mcap.part", tmp_path / "b.mcap").steps == 1


def test_a_disk_that_is_full_as_a_trial_is_stopped_does_not_hide_why(
    biped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def samples() -> Iterator[Sample]:
        yield from timed(made_up(biped, 20))
        monkeypatch.setattr(log_file.LogFile, "metadata", full)
        raise FallError

    with pytest.raises(FallError) as caught:
        write(tmp_path / "a.mcap", biped, samples(), timed=True)
    assert os.strerror(errno.ENOSPC) in caught.value.__notes__[0]
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap.part"]


class FullDisk(io.FileIO):
    """A file on a disk that has room for so many bytes."""

    room, error = 0, errno.ENOSPC

    def write(self, data: bytes | memoryview) -> int:
        """Writes, while there is room."""
        size = memoryview(data).nbytes
        if self.room < size:
            full(error=self.error)
        self.room -= size
        return super().write(data) or 0


SAID = {
    errno.ENOSPC: "the disk is full",
    errno.EFBIG: "the file has reached the size that this system allows",
}


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999])
@pytest.mark.parametrize("error", SAID)
def test_a_full_disk_and_a_limit_of_the_size_are_named_with_the_file(
    biped: Robot, log: Path, monkeypatch: pytest.MonkeyPatch, share: float, error: int
):
    room, folder = int(share * log.stat().st_size), log.parent / "full"
    folder.mkdir()

    def opened(path: Path, mode: str) -> io.BufferedWriter:
        raw = FullDisk(path, mode)
        raw.room, raw.error = room, error
        return io.BufferedWriter(raw)

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(LogWriteError, match=rf"a\.mcap\.part: {SAID[error]}") as caught:
        write(folder / "a.mcap", biped, made_up(biped, STEPS), hidden="intact")
    assert caught.value.errno == error
    assert [file.name for file in folder.iterdir()] == ["a.mcap.part"]


class Wrapped:
    """Samples that are looked at on their way; no generator."""

    def __init__(self, samples: Generator[Sample]) -> None:
        self.samples = samples

    def __iter__(self) -> Iterator[Sample]:
        """Returns the samples."""
        return self.samples

    def close(self) -> None:
        """Closes the samples."""
        self.samples.close()


def test_the_robot_stops_before_the_log_is_closed(biped: Robot, tmp_path: Path):
    order = []

    def samples(name: str) -> Iterator[Sample]:
        try:
            yield from made_up(biped, STEPS)
            yield Sample(-1.0, {})  # nobody asks for it
        finally:
            order.append((tmp_path / name).exists())

    write(tmp_path / "a.mcap", biped, samples("a.mcap"))
    write(tmp_path / "c.mcap", biped, Wrapped(samples("c.mcap")))
    assert order == [False, False]


class Timed(MadeUpRobot):
    """A physical robot with a clock of its own."""

    def clock(self) -> float:
        """Returns a time."""
        return 0.0

    def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
        """Yields made-up samples with their timing."""
        return timed(super().run(controller, steps))


@pytest.mark.parametrize("kind", [MadeUpRobot, Timed])
def test_a_physical_trial_is_that_of_its_log_and_timed_as_the_robot_is(
    biped: Robot, tmp_path: Path, kind: type[MadeUpRobot]
):
    path = tmp_path / "trial.mcap"
    header = TrialHeader(Settings(), timed=kind is MadeUpRobot)  # the robot decides
    trial = run_trial(kind(biped), plan_of(biped, 20), path, biped, header)
    log = read_log(path)

    assert (log.timing is not None) == (kind is Timed)
    assert (trial.plan, trial.path) == (log.trial.plan, str(path))
    assert_same_bits(trial.trajectory, log.trial.trajectory)


@pytest.mark.parametrize("case", ["whole", "short", "hanging", "not stopped", "before"])
def test_a_trial_that_the_robot_cannot_finish_is_a_trial_as_far_as_it_goes(
    biped: Robot, tmp_path: Path, case: str
):
    error = HangError("step hangs") if case == "hanging" else TrialError("it fell")
    if case == "not stopped":
        error.add_note("the safe command could not be sent")
    robot = MadeUpRobot(biped, MIN_STEPS - (case == "short"), error)
    plan = plan_of(biped, 2 * MIN_STEPS, "02-recovery")
    plan = dataclasses.replace(plan, stage="before" if case == "before" else "recovery")
    run = TrialRunner(tmp_path, biped, Settings())
    if case != "whole":
        with pytest.raises(TrialError, match=str(error)):
            run(robot, plan)
        return
    trial, log = run(robot, plan), read_log(tmp_path / "02-recovery.mcap")

    assert (trial.plan.steps, trial.trajectory.steps) == (2 * MIN_STEPS, MIN_STEPS)
    assert (log.status, log.reason) == ("stopped", "TrialError: it fell")
