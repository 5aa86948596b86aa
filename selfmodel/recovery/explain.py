"""Diagnosis from logged trials alone, as a recovery makes it trial by trial."""

from collections.abc import Callable, Collection, Sequence

from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError
from selfmodel.recovery.database import Database
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.random_streams import diagnosis_stream
from selfmodel.trials.trial import Trial


def diagnose_trials(
    trials: Sequence[Trial],
    diagnose: DiagnosticSearch,
    seed: int,
    on_event: Callable[[Event], None],
    after: Collection[int] | None = None,
) -> Diagnosis:
    """Returns the hypotheses that explain all trials, ranked.

    The trials are taken one by one, and each diagnosis seeds the next with its best hypotheses. So
    the trials and the seed of a recovery give the rankings that the recovery found.

    Args:
        trials: Those since something is wrong, in the order in which they were run.
        diagnose: The diagnostic EA.
        seed: Every random choice comes from it.
        on_event: Is told what happens.
        after: After how many trials a diagnosis is made, the last one included; after each, if none
            are given.

    Raises:
        InputError: There are no trials, or the comparator cannot judge one.
    """
    if not trials:
        raise InputError("expected at least one trial to explain, got none")
    diagnose.check(trials)
    known = Database()
    for number in range(1, len(trials) + 1) if after is None else sorted(after):
        on_event(SearchBegins("diagnostic"))
        diagnosis = diagnose(
            trials[:number], known.hypotheses, diagnosis_stream(seed, number), on_event
        )
        known = Database(diagnoses=(diagnosis,))
        on_event(diagnosis)
    return diagnosis
