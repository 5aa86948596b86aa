"""How the recordings of each group are diagnosed in the study of the documentation."""

from dataclasses import dataclass

PAPER = "break,jam,sensor"
WIDE = "break,jam,sensor,jam-angle,motor,friction,slope"
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
    "healthy": Question(WIDE),
    "wide": Question(ALL),
    "default": Question(DEFAULT, trials=3),
    "onset": Question(WIDE),
    "lost-encoder": Question(PAPER),
    "outside": Question(DEFAULT),
}
"""Question of each group."""
