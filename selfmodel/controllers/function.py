"""Policies that are functions of Python, in the place of a network: from observation to action."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import TrialError


@dataclass(frozen=True)
class Function:
    """A function of an observation, without a state: a search simulates many robots with it.

    Attributes:
        name: ``package.module:function``, or another name for error messages.
        function: From ``(inputs,)`` to ``(outputs,)``; a batched one from ``(n, inputs)``.
        outputs: Numbers of an action.
        batched: Whether it is called once for all robots, and not for one after another.
    """

    name: str
    function: Callable[[FloatArray], Any]
    outputs: int
    batched: bool = False

    def __hash__(self) -> int:
        return hash(self.name)

    def initial(self, _rows: int) -> tuple[FloatArray, ...]:
        """Returns no states, as those of a feed-forward ``Graph``."""
        return ()

    def step(
        self,
        rows: FloatArray,
        states: Sequence[FloatArray],
        _own: Mapping[str, FloatArray] = MappingProxyType({}),
    ) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        """Returns the action of each observation, as ``called``; NaN for one that is not finite."""
        actions = np.full((len(rows), self.outputs), np.nan)
        sound = np.flatnonzero(np.isfinite(rows).all(axis=1))
        if self.batched and len(sound):
            actions[sound] = called(
                self.name, self.function, rows[sound], (len(sound), self.outputs)
            )
        else:
            for row in sound:
                actions[row] = called(self.name, self.function, rows[row].copy(), (self.outputs,))
        return actions, tuple(states)

    def check(self, observation: FloatArray) -> None:
        """Raises ``TrialError`` unless an observation, ``(inputs,)``, has one finite action."""
        shape = (1, self.outputs) if self.batched else (self.outputs,)
        given = observation[np.newaxis] if self.batched else observation
        first = called(self.name, self.function, given.copy(), shape, finite=True).ravel()
        again, _ = self.step(np.tile(observation, (2, 1)), ())
        # A batch may round otherwise than a row.
        if not np.allclose(again, first, rtol=1e-5, atol=1e-6):
            raise TrialError(
                f"the function {self.name} returns two actions for one observation, which differ "
                f"by {np.abs(again - first).max():.3g}: it has a state, or is random; give it a "
                f"history or last_action as terms in place of a state, and the mean in place of "
                f"random numbers"
            )


def called(
    name: str,
    function: Callable[[Any], Any],
    observation: object,
    shape: tuple[int, ...],
    *,
    finite: bool = False,
) -> FloatArray:
    """Returns what a function returns for an observation, as numbers of a shape.

    Raises:
        TrialError: The function fails, or returns something else; the message names it.
    """
    try:
        given = np.asarray(function(observation))
        action = np.real(given).astype(np.float64)
    except Exception as error:  # a user's function may raise any: raised as a TrialError
        reason = " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")
        raise TrialError(f"the function {name} failed: {reason}") from error
    is_whole = action.size == math.prod(shape) and (len(shape) == 1 or action.shape == shape)
    if not is_whole or np.iscomplexobj(given):
        raise TrialError(
            f"the function {name} returns {given.dtype} numbers of the shape {given.shape}, "
            f"expected real ones of the shape {shape}, one for each motor"
        )
    if finite and not np.isfinite(action).all():
        raise TrialError(f"the function {name} returns {action.tolist()}, expected finite numbers")
    return action.reshape(shape)


def name_of(function: Callable[..., Any]) -> str:
    """Returns the name of a function, or of the class of an object that can be called."""
    return str(getattr(function, "__qualname__", type(function).__name__))
