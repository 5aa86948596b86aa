"""Diagnosis from logged trials only, trial by trial as in a recovery."""

from collections.abc import Callable, Collection, Sequence

from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError
from selfmodel.recovery.database import Database
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.random_streams import diagnosis_stream
from selfmodel.trials.trial import Trial


def simulated_steps(trials: Sequence[Trial], diagnose: DiagnosticSearch) -> int:
    """Returns the estimated number of control steps that ``diagnose_trials`` simulates.

    Args:
        trials: Trials since the failure, as for ``diagnose_trials``.
        diagnose: Diagnostic EA.

    Raises:
        InputError: A trial lacks signals that the comparator needs.
    """
    diagnose.check(trials)
    return sum(diagnose.simulated_steps(trials[:n]) for n in range(1, len(trials) + 1))


def diagnose_trials(
    trials: Sequence[Trial],
    diagnose: DiagnosticSearch,
    seed: int,
    on_event: Callable[[Event], None],
    after: Collection[int] | None = None,
) -> Diagnosis:
    """Returns the diagnosis of all trials.

    The trials are added one by one, and the best hypotheses of each diagnosis seed the next
    search. The trials and the seed of a recovery therefore reproduce the recovery's rankings.

    Args:
        trials: Trials since the failure, in the order in which they were run.
        diagnose: Diagnostic EA.
        seed: Seed of all random choices.
        on_event: Callback, called with each event as it happens.
        after: Numbers of trials after which to diagnose, including the number of all trials; after
            each trial, if not given.

    Raises:
        InputError: There are no trials, or a trial lacks signals that the comparator needs.
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
