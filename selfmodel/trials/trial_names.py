"""Names of trials in reports, which distinguish the logs of one diagnosis."""

from collections import Counter
from collections.abc import Iterable
from pathlib import PurePath

from selfmodel.trials.trial import Trial


def trial_names(trials: Iterable[Trial]) -> dict[str, str]:
    """Returns a name for each trial, by the trial's path.

    The name is that of the log's file, without ``.mcap``, and not that of the plan: every imported
    trial has the plan ``imported``. A trial without a log has the name of its plan. Where several
    trials would have one name, each of them has its whole path.

    Args:
        trials: All trials of a diagnosis.
    """
    names = {trial.path: _name(trial) for trial in trials}
    counts = Counter(names.values())
    return {path: name if counts[name] == 1 else path for path, name in names.items()}


def _name(trial: Trial) -> str:
    file = PurePath(trial.path)
    return file.stem if file.suffix.lower() == ".mcap" else trial.plan.name
