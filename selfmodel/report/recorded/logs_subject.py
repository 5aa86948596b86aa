"""The subject of a report on logs whose diagnosis is in a file."""

from collections.abc import Sequence
from pathlib import Path

from selfmodel import arguments
from selfmodel.arguments import AUTO, comparator_choice
from selfmodel.faults.kind import FaultKind
from selfmodel.report.recorded.calibration import recorded_calibration
from selfmodel.report.recorded.diagnosis_file import REMEDY, WHAT, read_diagnosis_file
from selfmodel.report.recorded.plug_ins import comparator_name, recorded_space
from selfmodel.report.run_result import parsed
from selfmodel.report.subject import Subject
from selfmodel.simulation.threads import thread_count
from selfmodel.trials.trial import trial_names


def subject_of_logs(
    paths: Sequence[Path],
    diagnosis: Path,
    *,
    robot: str | None = None,
    threads: int = 0,
    comparator: str = AUTO,
    kinds: Sequence[FaultKind] = (),
) -> Subject:
    """Returns the subject of a report on logs that were diagnosed before.

    Args:
        paths: The logs of the diagnosis, in any order.
        diagnosis: Output of ``selfmodel diagnose --json``, or the ``result.json`` of a recovery.
        robot: Self-model instead of that in the logs, as in ``--robot`` of the diagnosis.
        threads: Threads of the physics; 0 for all processors.
        comparator: ``auto`` for the comparator that the file names; its name, such as
            ``package.module:object``, if it is no entry point.
        kinds: Fault kinds of the diagnosis that are no entry points.

    Raises:
        InputError: The diagnosis is of other logs, of another self-model or with another
            comparator, or a file is damaged.
    """
    file = read_diagnosis_file(diagnosis)
    explained, intact = file.matched(paths)
    logs = arguments.read_logs([*explained, *intact])
    model = arguments.robot_of_logs(logs, robot)
    file.check_self_model(model)
    found = file.diagnosis(recorded_space(diagnosis, model, file.kinds, kinds))
    trials = [log.trial for log in logs]
    damaged, healthy = tuple(trials[: len(explained)]), tuple(trials[len(explained) :])
    name = comparator_name(diagnosis, file.comparator, comparator)
    count = thread_count(threads)
    return Subject(
        title=", ".join(trial_names(damaged).values()),
        robot=model,
        healthy=healthy,
        damaged=damaged,
        diagnoses=(found,),
        comparator=comparator_choice(name)(model, [*healthy, *damaged]).comparator,
        calibration=parsed(
            diagnosis,
            lambda: recorded_calibration(model, healthy, file.calibration, count),
            WHAT,
            REMEDY,
        ),
        made_with=logs[0].software,
        notes=file.notes(),
        threads=count,
    )
