"""The command ``check``: the contract of a plug-in, checked in one call."""

import traceback
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from selfmodel import testing
from selfmodel.cli.commands import Check
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.errors import InputError, WorkError, check_name
from selfmodel.testing.contract import ContractError

_SAME, _ALONE, _KEPT = "equal arguments, equal results", "no dependence on the batch", "no change"
CHECKS: Mapping[str, tuple[Callable[..., None], tuple[str, ...]]] = MappingProxyType(
    {
        "comparator": (
            testing.check_comparator,
            ("distances finite, at least 0, and 0 for the trial itself", _SAME, _ALONE, _KEPT),
        ),
        "kind": (
            testing.check_fault_kind,
            (
                "levels within their bounds, words and notation that tell all faults apart",
                f"{_SAME}, and another robot for some fault",
                _ALONE,
                "no change of the healthy robot",
            ),
        ),
        "score": (
            testing.check_score,
            ("one number for each rollout, from the signals in record", _SAME, _ALONE, _KEPT),
        ),
        "next-trial": (
            testing.check_next_trial,
            ("a controller of the robot, in a short recovery", _SAME, "no change of the loop"),
        ),
        "controller": (
            testing.check_design,
            ("commands finite and in range", _SAME, _ALONE, "written to a file and read back"),
        ),
        "search": (
            testing.check_search,
            ("genomes in [-1, 1], the initial ones first", _SAME, "as many evaluations as told"),
        ),
    }
)
"""Function that checks each sort of plug-in, and the rules that it checks."""

_OF_A_ROBOT = ("kind", "score", "controller")


def check(options: Check) -> None:
    """Checks that a plug-in fulfils its contract."""
    what, name = options.what, options.plug_in
    check_name("sort of plug-in", what, CHECKS)
    given: dict[str, Any] = {} if options.self_model is None else {"robot": options.self_model}
    if given and what not in _OF_A_ROBOT:
        raise InputError(f"--robot is for {', '.join(_OF_A_ROBOT)}, got {what}: leave it out")
    function, rules = CHECKS[what]
    try:
        function(name, **given)
    except (ContractError, InputError) as error:
        if isinstance(error, ContractError) and error.__cause__:
            print_notes(*"".join(traceback.format_exception(error.__cause__)).splitlines())
        raise WorkError(f"{what} {name}: {error}") from error
    except Exception as error:  # a plug-in may raise any exception
        print_notes(*"".join(traceback.format_exception(error)).splitlines())
        line = " ".join(traceback.format_exception_only(error)[-1].split())
        raise WorkError(f"{what} {name} raised {line}: correct it where the lines say") from error
    if options.as_json:
        print_json({"what": what, "name": name, "rules": rules})
    else:
        print_lines(f"{what} {name} fulfils its contract:", *(f"  {rule}" for rule in rules))
