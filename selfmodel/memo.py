"""Numbers that are computed once.

Each of the EAs has its own: a repair keeps the way that a run went, a diagnosis its distance to one
trial. Behaviours are not kept, so a controller that was tried is simulated once more for each trial
it is compared with; everything else is simulated once.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Generic, TypeVar

import numpy as np

from selfmodel.arrays import FloatArray

Key = TypeVar("Key", bound=Hashable)


class Memo(Generic[Key]):
    """Remembers a number for every key it was ever asked for."""

    def __init__(self) -> None:
        self._known: dict[Key, float] = {}

    def __len__(self) -> int:
        return len(self._known)

    def __iter__(self) -> Iterator[Key]:
        return iter(self._known)

    def values(self, keys: Sequence[Key], compute: Callable[[list[Key]], FloatArray]) -> FloatArray:
        """Returns the number of each key, ``(n,)``.

        Args:
            keys: What is asked for; repetitions are fine.
            compute: From the keys not known yet, each once, to their numbers.
        """
        unknown = list(dict.fromkeys(key for key in keys if key not in self._known))
        if unknown:
            self._known.update(zip(unknown, map(float, compute(unknown)), strict=True))
        return np.array([self._known[key] for key in keys])
