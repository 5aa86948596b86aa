"""Comparators and fault kinds that a file names; no name of a file is imported."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from selfmodel import plugins
from selfmodel.arguments import AUTO
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.robot.robot import Robot


def comparator_name(path: Path, recorded: str, given: str) -> str:
    """Returns the name by which the recorded comparator is found.

    Args:
        path: The file.
        recorded: Name of the comparator in the file.
        given: Name of ``--comparator``: where the recorded comparator is, such as
            ``package.module:object``; ``auto`` for one that its own name finds.

    Raises:
        InputError: The given comparator is another than the recorded one, or the file names a
            module.
    """
    if given == AUTO:
        return installed(path, recorded)
    name = plugins.comparator(given).name
    if name != recorded:
        raise InputError(
            f"{path} has distances by the comparator {recorded}, and --comparator {given} is "
            f"{name}: leave --comparator out, which is for a comparator package.module:object"
        )
    return given


def recorded_space(
    path: Path, robot: Robot, recorded: Iterable[str], given: Sequence[FaultKind]
) -> HypothesisSpace:
    """Returns the hypotheses of built-in, recorded and given kinds.

    Args:
        path: The file.
        robot: The robot.
        recorded: Names of the fault kinds in the file.
        given: Kinds of ``--kinds``, which the file may name.

    Raises:
        InputError: The file names a module, or no kind has a name.
    """
    known = {kind.name for kind in given}
    named = [installed(path, name) for name in recorded if name not in known]
    found = plugins.kinds(",".join(named)) if named else ()
    return HypothesisSpace(robot.anatomy, tuple(dict.fromkeys((*ALL_KINDS, *found, *given))))


def installed(path: Path, name: str) -> str:
    """Returns a name that imports no code: a file of others may name any module.

    Args:
        path: The file.
        name: Name of a comparator or a fault kind in the file.

    Raises:
        InputError: The name is that of a module.
    """
    if ":" in name:
        raise InputError(
            f"{path} names the plug-in {name!r}, and a report imports nothing that a file names: "
            f"name it by --comparator or --kinds, or give it an entry point"
        )
    return name
