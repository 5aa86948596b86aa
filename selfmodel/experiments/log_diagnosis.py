"""Set-up of a diagnosis from logged trials: robot, calibration, search, seed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from selfmodel.diagnosis.comparator_choice import ChosenComparator, ComparatorChoice
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.errors import InputError
from selfmodel.experiments import trial_logs
from selfmodel.experiments.arguments import TrialSource
from selfmodel.experiments.fitting import fitted
from selfmodel.faults.kind import FaultKind
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.threads import thread_count
from selfmodel.trials.trial import Trial


@dataclass(frozen=True, eq=False)
class LogDiagnosis:
    """Inputs of a diagnosis from logged trials.

    Attributes:
        damaged: Trials to explain, in the order in which they were run.
        healthy: Trials of the healthy robot.
        comparator: The comparator, and the reason for its choice.
        calibration: Fit of the self-model to the healthy trials; None without a fit.
        search: The diagnostic EA.
        seed: Seed of all random numbers.
    """

    damaged: tuple[Trial, ...]
    healthy: tuple[Trial, ...]
    comparator: ChosenComparator
    calibration: Calibration | None
    search: DiagnosticSearch
    seed: int


def set_up_diagnosis(
    trials: Sequence[TrialSource],
    healthy: Sequence[TrialSource] = (),
    *,
    robot: Robot | None,
    choose_comparator: ComparatorChoice,
    kinds: Sequence[FaultKind],
    settings: Settings | None,
    seed: int | None,
    calibrate: bool,
    threads: int,
) -> LogDiagnosis:
    """Returns the inputs of a diagnosis: reads the logs, calibrates, and sets up the search.

    Args:
        trials: Trials to explain. Without ``healthy``, those of the stage ``before`` are healthy
            if there are trials of other stages.
        healthy: Trials of the healthy robot.
        robot: The nominal robot; None for the model in the logs.
        choose_comparator: Chooses the comparator, before the calibration.
        kinds: Fault kinds to search.
        settings: Parameters of the search; None for those in the first log to explain, or the
            defaults for a trial without a log.
        seed: Seed of all random numbers; None for that of the first trial to explain.
        calibrate: Whether the self-model is fitted to the healthy trials.
        threads: Threads of the physics; 0 for all processors.

    Raises:
        InputError: There are no trials, a log is unusable, or a trial has no log and no robot is
            given, or no comparator can judge all trials.
    """
    if not trials:
        raise InputError("expected at least one trial to explain, got none")
    sources = [*trials, *healthy]
    read = {log.trial.path: log for log in trial_logs.logs(_paths(sources))}
    found = [s if isinstance(s, Trial) else read[str(Path(s))].trial for s in sources]
    if robot is None and len(read) < len(found):
        raise InputError(
            "a trial without a log has no model of its robot: give robot=, such as "
            'selfmodel.load_robot("quadruped")'
        )
    nominal = trial_logs.robot_of_logs(list(read.values()), None) if robot is None else robot
    to_explain, reference = found[: len(trials)], found[len(trials) :]
    if not reference:
        to_explain, reference = by_stage(to_explain)
    first = to_explain[0]
    if settings is None:
        settings = read[first.path].settings if first.path in read else Settings()
    chosen = choose_comparator(nominal, [*reference, *to_explain])
    count = thread_count(threads)
    fit = fitted(nominal, reference, count) if calibrate and reference else None
    simulator = Simulator(fit.robot if fit else nominal, count)
    return LogDiagnosis(
        damaged=tuple(to_explain),
        healthy=tuple(reference),
        comparator=chosen,
        calibration=fit,
        search=DiagnosticSearch(simulator, chosen.comparator, settings, kinds, intact=reference),
        seed=first.plan.seed if seed is None else seed,
    )


def by_stage(trials: Sequence[Trial]) -> tuple[list[Trial], list[Trial]]:
    """Returns the trials to explain and the trials of the healthy robot, by their stages.

    Trials of the stage ``before`` are healthy, unless there are no others.
    """
    failed = [trial for trial in trials if trial.plan.stage != "before"] or list(trials)
    return failed, [trial for trial in trials if trial not in failed]


def _paths(sources: Sequence[TrialSource]) -> list[Path]:
    return [Path(source) for source in sources if not isinstance(source, Trial)]
