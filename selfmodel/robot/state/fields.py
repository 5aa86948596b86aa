"""Signals as functions of MuJoCo's state of many robots."""

from collections.abc import Callable
from dataclasses import dataclass

from selfmodel.arrays import FloatArray

Bind = Callable[[str], FloatArray]
"""Returns the array of a field of MuJoCo's state of many robots, ``(n, width)``, by name."""

Reader = Callable[[], FloatArray]
"""Returns the current value of a signal, ``(n, width)``; the value may be a view of the state."""


@dataclass(frozen=True)
class StateField:
    """A signal that MuJoCo's state contains: columns of a field of MjData.

    Attributes:
        field: Name of the field, such as ``qpos``.
        columns: Columns of the field.
    """

    field: str
    columns: slice | list[int]

    def reader(self, bind: Bind) -> Reader:
        """Returns a function that reads the signal from the bound state."""
        values, chosen = bind(self.field), self.columns
        return lambda: values[:, chosen]


@dataclass(frozen=True, eq=False)
class ShiftedField:
    """A signal that differs from a field of MuJoCo's state by constants.

    Attributes:
        field: The field.
        shift: Signal minus field, ``(n, width)``.
    """

    field: StateField
    shift: FloatArray

    def reader(self, bind: Bind) -> Reader:
        """Returns a function that reads the signal from the bound state."""
        true = self.field.reader(bind)
        return lambda: true() + self.shift


@dataclass(frozen=True)
class DerivedSignal:
    """A signal that is computed from positions and velocities.

    Attributes:
        compute: Function from ``qpos``, ``(n, nq)``, and ``qvel``, ``(n, nv)``, to the signal,
            ``(n, width)``.
    """

    compute: Callable[[FloatArray, FloatArray], FloatArray]

    def reader(self, bind: Bind) -> Reader:
        """Returns a function that computes the signal from the bound state."""
        qpos, qvel = bind("qpos"), bind("qvel")
        return lambda: self.compute(qpos, qvel)
