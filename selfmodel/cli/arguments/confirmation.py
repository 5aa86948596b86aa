"""Confirmation of work whose expected time is above the budget."""

from selfmodel.cli.output.printing import print_notes
from selfmodel.sandbox.budget import Budget, BudgetError


def confirm_time(seconds: float, budget: Budget, *, yes: bool) -> None:
    """Checks that a command may take its expected time; prints the time if ``--yes`` allows it.

    Args:
        seconds: Expected time, s.
        budget: Budget of the command.
        yes: Whether ``--yes`` was given.

    Raises:
        BudgetError: The time is above the budget, and not allowed.
    """
    if seconds <= budget.time:
        return
    if not yes:
        raise BudgetError(
            f"this takes about {duration(seconds)}, more than {duration(budget.time)}: --yes or "
            f"--budget time=... to go on"
        )
    print_notes(f"note: this takes about {duration(seconds)}")


def duration(seconds: float) -> str:
    """Returns a duration in its natural unit, such as ``4 min``."""
    for unit, size in (("days", 86_400), ("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.2g} s"
