"""Command-line values as objects."""

from selfmodel.errors import InputError, unknown_name
from selfmodel.tasks import Entry
from selfmodel.trials.trial import STAGES, Stage, stage_of


def case_notation(entry: Entry, case: int | None, damage: str | None) -> str:
    """Returns the notation of a failure given by its number in Table I or by itself.

    Raises:
        InputError: Neither or both are given, or there is no case of that number.
    """
    if (case is None) == (damage is None):
        given = "neither" if case is None else "both"
        numbers, example = ", ".join(map(str, entry.cases)), next(iter(entry.cases.values()))
        raise InputError(
            f"expected either --case N or --damage NOTATION, got {given}: cases are {numbers}, a "
            f"notation is like {example}"
        )
    if damage is not None:
        return damage
    if case is None or case not in entry.cases:
        raise unknown_name("case of Table I", str(case), map(str, entry.cases))
    return entry.cases[case]


def stage(name: str) -> Stage:
    """Returns where in a story a trial stands.

    Raises:
        InputError: There is no such place; the message names the nearest.
    """
    found = stage_of(name)
    if found is None:
        raise unknown_name("stage", name, STAGES)
    return found
