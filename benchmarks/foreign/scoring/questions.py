"""How the recordings of each group are diagnosed in the study of the documentation."""

from dataclasses import dataclass

PAPER = "break,jam,sensor"
DEFAULT = ""
ALL = "all"


@dataclass(frozen=True)
class Question:
    """How a recording is diagnosed.

    Attributes:
        kinds: Value of ``--kinds``; empty for the default.
        trials: Number of trials with the faults.
        options: Further options of ``diagnose``.
    """

    kinds: str = DEFAULT
    trials: int = 1
    options: tuple[str, ...] = ()


QUESTIONS = {
    "paper": Question(PAPER),
    "healthy": Question(DEFAULT),
    "wide": Question(ALL),
    "default": Question(DEFAULT, trials=3),
    "onset": Question(DEFAULT),
    "lost-encoder": Question(PAPER),
    "outside": Question(DEFAULT),
}
"""Question of each group."""
