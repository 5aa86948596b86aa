"""The errors of selfmodel, the parts of their sentences, and checks of arguments."""

import difflib
import inspect
import math
import os
from collections.abc import Callable, Collection, Iterable, Sequence, Set as AbstractSet
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from types import UnionType
from typing import Any, Protocol, TypeVar, Union, cast, get_args, get_origin, runtime_checkable


class InputError(ValueError):
    """Invalid input of the user.

    The message is one sentence: the expected input, the actual input, and the remedy. The command
    line prints the message and exits with status 2.
    """


class WorkError(RuntimeError):
    """Failure of an operation on valid input."""


class TrialError(WorkError):
    """A trial that a physical robot could not finish."""


def describe(error: BaseException) -> str:
    """Returns the message of an error with its notes, such as a failed stop of a robot."""
    return "; ".join(filter(None, (str(error), *getattr(error, "__notes__", ()))))


def unknown_name(what: str, name: str, known: Iterable[str]) -> InputError:
    """Returns the error for an unknown name of ``what``, such as a robot, with the nearest ones."""
    names = [str(item) for item in known]
    nearest = _nearest(str(name), names)
    hint = f"did you mean {listed(nearest)}? " if nearest else ""
    return InputError(f"unknown {what} {name!r}: {hint}the known ones are {listed(names)}")


def check_name(what: str, name: str, known: Collection[str]) -> None:
    """Raises ``InputError`` with the nearest names for a name that is unknown."""
    if not isinstance(name, str) or name not in known:
        raise unknown_name(what, name, known)


def check_type(got: object, known: type | UnionType, expected: str) -> None:
    """Raises ``InputError`` for an object of another type; ``expected`` is part of its sentence."""
    if not isinstance(got, known):
        has_trial = "trials" in expected and hasattr(got, "trial")
        remedy = ": give its attribute trial" if has_trial else ""
        raise InputError(f"expected {expected}, got an object of type {type(got).__name__}{remedy}")


_HAD_BY = {
    "DataFrame": 'selfmodel.load("runs/ablation").comparisons()',
    "Hypothesis": 'selfmodel.parse_hypothesis("intact", robot)',
    "Robot": 'selfmodel.load_robot("quadruped")',
    "Trial": 'selfmodel.read_log("walk.mcap").trial',
}


@runtime_checkable
class _Array(Protocol):
    """An array of any library."""

    def __array__(self) -> Any: ...  # noqa: ANN401  # that of numpy


_WIDER: dict[str, Any] = {
    "float": Real,
    "int": Real,
    "ndarray": _Array,
    "Path": str | os.PathLike,
    "tuple": tuple | list,
}
Target = TypeVar("Target", bound=Callable[..., Any])


def typed(target: Target) -> Target:
    """Decorator: refuses, in a sentence, arguments of other classes than their annotations'.

    The items of tuples and the like are not checked, and what is no class is not. A class has the
    arguments of its constructor.
    """
    function = getattr(target, "__init__") if isinstance(target, type) else target  # noqa: B009
    parameters = inspect.signature(function).parameters.items()
    classes = {name: _classes(one.annotation) for name, one in parameters}
    accepted = {
        name: tuple(_WIDER.get(one.__name__, one) for one in own) for name, own in classes.items()
    }

    @wraps(function)
    def checked(*given: object, **named: object) -> object:
        for name, value in (*zip(classes, given, strict=False), *named.items()):
            if not isinstance(scalar_of(value), accepted.get(name, object)):
                names = [one.__name__.replace("NoneType", "None") for one in classes[name]]
                remedy = _HAD_BY.get(names[0], f"what help({target.__qualname__}) says")
                raise InputError(
                    f"expected {name} of type {' or '.join(names)}, got "
                    f"{' '.join(repr(value).split()):.80}: give {remedy}"
                )
        return function(*given, **named)

    if not isinstance(target, type):
        return cast("Target", checked)
    target.__init__ = checked  # type: ignore[misc]  # that of this class
    return target


def _classes(annotation: Any) -> tuple[type, ...]:  # noqa: ANN401  # any annotation
    """Returns the classes of an annotation; ``object`` for one that is none."""
    origin = get_origin(annotation) or annotation
    if origin in (Union, UnionType):
        return tuple(one for part in get_args(annotation) for one in _classes(part))
    is_class = isinstance(origin, type) and not getattr(origin, "_is_protocol", False)
    return (origin if is_class and origin not in (Any, inspect.Parameter.empty) else object,)


def check_function(name: str, given: object) -> None:
    """Raises ``InputError`` for an argument that cannot be called."""
    if not callable(given):
        raise InputError(f"expected a function as {name}, got {given!r:.80}: leave it out")


def real_number(
    name: str, value: object, example: float, least: float = -math.inf, kind: str = "finite"
) -> float:
    """Returns an argument as a float; a bool is no number, and an array without axes is one.

    Raises:
        InputError: It is no number of the kind, finite, whole or real, or less than the least.
    """
    value = scalar_of(value)
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        of_kind = {"finite": math.isfinite(number), "whole": number.is_integer()}.get(kind, True)
        if of_kind and (number >= least or least == -math.inf):
            return number
    bound = f" of {least:g} or above" if math.isfinite(least) else ""
    raise InputError(
        f"expected a {kind} number{bound} as {name}, got {value!r:.80}: give one such as "
        f"{name}={example}"
    )


def whole_number(name: str, value: object, example: int, least: float = -math.inf) -> int:
    """Returns an argument as an int, where that is exact, as of 1e3; see ``real_number``."""
    value = scalar_of(value)
    if isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= least:
        return int(value)
    return int(real_number(name, value, example, least, "whole"))


def scalar_of(value: object) -> object:
    """Returns the number of a numpy scalar or of an array without axes; others as they are."""
    item: Callable[[], object] | None = getattr(value, "item", None)
    return item() if item is not None and getattr(value, "shape", None) == () else value


def items_of(source: object) -> list[object]:
    """Returns the items of a sequence, or sorted of a set, whose order is another in each process.

    Anything else, such as a text, is one item.
    """
    source = scalar_of(source)
    if isinstance(source, str) or not isinstance(source, Iterable):
        return [source]
    return sorted(source, key=str) if isinstance(source, AbstractSet) else list(source)


def whole_numbers(
    name: str, source: object, example: int, least: float = -math.inf
) -> tuple[int, ...]:
    """Returns whole numbers, given as one or in a sequence; see ``whole_number``."""
    return tuple(whole_number(name, one, example, least) for one in items_of(source))


def real_numbers(name: str, source: object) -> tuple[float, ...]:
    """Returns numbers, whose range is not checked, given as one or in a sequence."""
    return tuple(real_number(name, one, 0.05, kind="real") for one in items_of(source))


def names_of(source: object, expected: str, also: type = Path) -> tuple[str, ...]:
    """Returns texts, or objects of another type as texts, given as one or in a sequence."""
    found = items_of(source)
    for one in found:
        check_type(one, str | also, expected)
    return tuple(map(str, found))


_MOST_COMPARED, _LONGEST_COMPARED = 1000, 200


def _nearest(name: str, names: list[str]) -> list[str]:
    """Returns the most similar names; a file may have too many or too long ones to compare."""
    if len(name) > _LONGEST_COMPARED or len(names) > _MOST_COMPARED:
        return []
    short = [one for one in names if len(one) <= _LONGEST_COMPARED]
    folded = difflib.get_close_matches(name.casefold(), map(str.casefold, short), cutoff=0.5)
    return sorted(
        (one for one in short if one.casefold() in folded),
        key=lambda one: folded.index(one.casefold()),
    )


def listed(names: Sequence[str], most: int = 200) -> str:
    """Returns names as part of a sentence: separated by commas, and the number beyond the most."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more


def joined(names: Sequence[str]) -> str:
    """Returns names as part of a sentence: ea, ea+stepwise and stepwise."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def counted(number: float, noun: str) -> str:
    """Returns a number and its noun in the singular or plural.

    Examples:
        >>> counted(1, "log"), counted(2, "batch")
        ('1 log', '2 batches')
    """
    ending = "" if number == 1 else "es" if noun.endswith("ch") else "s"
    return f"{number} {noun}{ending}"
