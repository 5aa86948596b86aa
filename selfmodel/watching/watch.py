"""Watch: whether a robot is as it was in its healthy trials, and if not, since when and why."""

import dataclasses
from collections import deque
from collections.abc import Sequence

from selfmodel import arguments
from selfmodel.arguments import KindSource, RobotSource, TrialSource
from selfmodel.arrays import FloatArray
from selfmodel.comparators.segment_prediction import (
    COMPARISONS,
    SEGMENT_PREDICTION,
    SEGMENT_PREDICTION_ONBOARD,
)
from selfmodel.diagnosis.adequacy import MAX_LEFT
from selfmodel.diagnosis.choice import chosen_comparator
from selfmodel.diagnosis.comparator import TrialRefusedError
from selfmodel.diagnosis.significance import MIN_PIECES, share_left
from selfmodel.errors import real_number
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator, thread_count
from selfmodel.trials.trajectory import Sample
from selfmodel.trials.trial import Trial, TrialPart
from selfmodel.watching.bank import MAX_PIECES, Bank
from selfmodel.watching.detector import MEMORY, Detector
from selfmodel.watching.finding import ENDS, Finding, Rated, Status
from selfmodel.watching.reference import reference_of
from selfmodel.watching.segments import Window, last_segment, scores_of

SEGMENT = 0.12
"""Length of a segment, s, at any control time step."""

FIRST_PIECES = 4
"""Segments since a change from which on causes are compared."""

PAUSE = 8
"""Segments that the healthy trials have to cover before the robot is judged again: a motion of
which they cover a part is another one."""

MAX_LISTED = 8
"""Causes that a finding lists, at most, the best first."""

FEW = 4
"""Causes that are left, at most, when they are said before the end."""


class Watch:
    """Watches a robot step by step, as its control loop or its trial log gives them.

    A segment of the comparator of segments is predicted as soon as it is complete, by a self-model
    that is fitted to the healthy trials. A sequential test says that the robot changed; then single
    faults are compared over the segments since the change.

    A watch ends with a cause, or with several, or with none. If nothing but ``intact`` is left, the
    alarm was false, and it goes on.

    Example:
        >>> import selfmodel
        >>> walk = selfmodel.read_log("before.mcap").trial.plan.controller
        >>> robot = selfmodel.load_robot("quadruped")
        >>> physical = selfmodel.simulated_robot(robot)
        >>> trial = selfmodel.run_trial(physical, walk, "w.mcap", robot=robot, steps=2000)
        >>> watch = selfmodel.Watch(robot, trial, calibrate=False)
        >>> findings = [one for step in physical.run(walk, 100) for one in watch.update(step)]
        >>> [one.status for one in findings]
        ['watching']

    Args:
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        healthy: Trials of the healthy robot, or paths of their logs, in the motions that are to be
            judged. The errors in each half are those of a self-model fitted to the other halves.
        kinds: Fault kinds of the causes, or names of kinds and of their sets, in a sequence or
            separated by commas.
        false_alarm_every: Mean time between false alarms that the threshold aims at, s of motions
            that are judged. No proof says that it is reached.
        calibrate: Whether the self-model is fitted to the healthy trials.
        threads: Threads of the physics; 0 for all processors.

    Raises:
        InputError: The healthy trials are too short or unusable, or an argument is invalid.
    """

    def __init__(
        self,
        robot: RobotSource,
        healthy: TrialSource | Sequence[TrialSource],
        *,
        kinds: KindSource = DEFAULT_KINDS,
        false_alarm_every: float = 3600.0,
        calibrate: bool = True,
        threads: int = 1,
    ) -> None:
        arguments.check_options(lambda _event: None, calibrate=calibrate)
        every = real_number("false_alarm_every", false_alarm_every, 3600.0, 1.0)
        robot, count = arguments.load_robot(robot), thread_count(threads)
        (trials,), _ = arguments.trials_of(healthy)
        arguments.check_trials(robot, *trials)
        able = {one.name: one for one in (SEGMENT_PREDICTION, SEGMENT_PREDICTION_ONBOARD)}
        chosen = able[chosen_comparator([*able.values()], robot, trials).comparator.name]
        self._step = robot.control_timestep
        self._horizon = max(COMPARISONS, round(SEGMENT / self._step))
        self._comparator = dataclasses.replace(chosen, horizon=self._horizon, only_last=True)

        def fitted(parts: Sequence[Trial]) -> Robot:
            return arguments.fitted(robot, parts, count).robot if calibrate else robot

        self._reference = reference_of(robot, trials, self._comparator, fitted)
        self._space = HypothesisSpace.of(arguments.kinds_of(kinds), robot.anatomy)
        self._simulator = Simulator(self._reference.robot, count)
        self._run_length = every / (self._step * self._horizon)
        self.restart()

    @property
    def robot(self) -> Robot:
        """The self-model, fitted to the healthy trials."""
        return self._reference.robot

    def update(self, step: Sample) -> tuple[Finding, ...]:
        """Adds a step, and returns what is new: most steps have no finding.

        After an alarm, each call simulates a few of the causes.

        Args:
            step: State, readings and commands of the next control step, NaN where not observed, as
                ``PhysicalRobot.run`` yields them.
        """
        newest = self._window.add(step)
        if self._status in ENDS:
            return ()
        if self._status != "changed":
            return () if newest is None else tuple(self._judge(newest))
        if newest is not None and (found := self._add(newest)):
            return tuple(found)
        return tuple(self._advanced())

    def finish(self) -> tuple[Finding, ...]:
        """Returns what the steps so far say about the cause of a change: no other step comes."""
        found = list[Finding]()
        while self._status == "changed" and self._bank is not None and self._bank.is_busy:
            found += self._advanced()
        return tuple(found)

    def restart(self) -> None:
        """Begins anew with the next step, at time 0: of another log, or of a repaired robot."""
        self._window = Window(self.robot, self._horizon)
        self._status: Status | None = None
        self._pause = 0
        self._forget()

    def _forget(self) -> None:
        self._detector = Detector(self._run_length)
        self._recent: deque[TrialPart] = deque(maxlen=MAX_PIECES)
        self._ends: deque[float] = deque(maxlen=MEMORY + 1)
        self._change = Finding(0.0, "watching")
        self._bank: Bank | None = None
        self._since = self._refused = 0
        self._named: tuple[object, ...] = ()

    def _judge(self, newest: Trial) -> list[Finding]:
        """Returns the findings of a segment as long as no change is known."""
        reason = self._reference.uncovered(newest, self._horizon)
        if not reason:
            try:
                scores, _ = scores_of(self._simulator, self._comparator, newest)
            except TrialRefusedError as error:
                reason = error.reason
        self._pause = PAUSE if reason else max(self._pause - 1, 0)
        if self._pause:
            self._detector = Detector(self._run_length)  # what came before may be another motion
            return self._said("not judged", reason)
        if not self._has_alarm(newest, scores):
            return self._said("watching")
        self._status = "changed"
        return [self._change]

    def _has_alarm(self, newest: Trial, scores: FloatArray) -> bool:
        """Adds a segment to the test, and dates the change if there is an alarm."""
        self._recent.append(self._part(newest))
        self._ends.append(self._time)
        if not self._detector.update(self._reference.log_e_values(scores)):
            return False
        ends, length = [*self._ends], self._step * self._horizon
        age, oldest, latest = (min(one, len(ends) - 1) for one in self._detector.onset())
        # The change may not have shown at first, or while the robot was not judged.
        before = ends[: len(ends) - 1 - oldest]
        self._change = Finding(
            self._time,
            "changed",
            onset=round(ends[-1 - age] - length, 6),
            earliest=round(before[-1] - length, 6) if before else 0.0,
            latest=ends[-1 - latest],
            shown_by=self._shown_by(),
        )
        # The first segment that shows it may be one in which it began.
        self._since = max(self._since, age)
        return True

    def _shown_by(self) -> tuple[str, ...]:
        return tuple(self._reference.channels[k] for k in self._detector.shown_by())

    def _add(self, newest: Trial) -> list[Finding]:
        """Adds a segment after a change; the first ones also date it anew."""
        try:
            if self._bank is not None:
                last_segment(self.robot, self._comparator, newest)
                self._bank.add(self._part(newest))
            else:
                scores, _ = scores_of(self._simulator, self._comparator, newest)
                self._since += 1
                self._has_alarm(newest, scores)
                if self._since >= FIRST_PIECES:
                    self._bank = self._new_bank()
        except TrialRefusedError as error:
            self._refused += 1
            if self._refused < MAX_PIECES:
                return []
            reason = f"the last {MAX_PIECES} segments cannot be used: {error.reason}"
            return [self._about("unexplained", (), reason)]
        self._refused = 0
        return []

    def _new_bank(self) -> Bank:
        """Returns the causes, with the segments since the change."""
        segments = [*self._recent][-self._since :]
        since = self._window.trial(len(segments) * self._horizon + 1)
        self._change = dataclasses.replace(self._change, shown_by=self._shown_by())
        hinges = self.robot.anatomy.hinges
        shown = [hinges.index(name) for name in self._change.shown_by if name in hinges]
        bank = Bank(self._simulator, self._comparator, self._space, since, shown)
        for one in segments:
            bank.add(one)
        return bank

    def _advanced(self) -> list[Finding]:
        """Simulates a few causes, and returns what is new about them."""
        if self._bank is None or not (remaining := self._bank.advance()):
            return []
        return self._compared(remaining, self._bank)

    def _compared(self, remaining: Sequence[Rated], bank: Bank) -> list[Finding]:
        """Returns what is new about the cause, by the hypotheses that are left."""
        is_last = bank.segments >= MAX_PIECES
        if bank.segments >= MIN_PIECES and (len(remaining) == 1 or is_last):
            return self._ended(remaining, bank)
        named = tuple(rated.hypothesis.without_severities for rated in remaining)
        if len(named) > FEW or set(named) == set(self._named):
            return []
        self._named = named
        return [self._about("changed", remaining)]

    def _ended(self, remaining: Sequence[Rated], bank: Bank) -> list[Finding]:
        """Returns the last finding about a change."""
        best, *others = remaining
        if best.hypothesis == INTACT and not others:
            self._forget()
            return self._said("watching")
        own, intact = bank.compared(best.hypothesis, INTACT).mean(axis=1).tolist()
        left = share_left(own, intact, self._reference.loss_with(bank.hinges))
        if left is not None and left > MAX_LEFT:
            reason = f"no single fault explains more than {1 - MAX_LEFT:.0%} of the errors"
            return [self._about("unexplained", remaining, reason)]
        return [self._about("ambiguous" if others else "explained", remaining)]

    def _about(self, status: Status, remaining: Sequence[Rated], reason: str = "") -> Finding:
        self._status = status
        return dataclasses.replace(
            self._change,
            time=self._time,
            status=status,
            reason=reason,
            remaining=tuple(remaining[:MAX_LISTED]),
        )

    def _said(self, status: Status, reason: str = "") -> list[Finding]:
        is_new, self._status = status != self._status, status
        return [Finding(self._time, status, reason)] if is_new else []

    def _part(self, trial: Trial) -> TrialPart:
        return TrialPart(trial, begin=float(trial.trajectory.time[-1 - self._horizon]))

    @property
    def _time(self) -> float:
        return round((self._window.steps - 1) * self._step, 6)
