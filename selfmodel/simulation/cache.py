"""Cache of computed rows of numbers, by key.

Each search has caches of its own: a repair search keeps the outcome of each run, a diagnostic
search the losses of each hypothesis on each trial. Behaviours are not kept, so a controller of the
repair search is simulated again for each trial that it is compared with. Within a search nothing
else is computed twice.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import Any, Generic, TypeVar

from selfmodel.arrays import FloatArray

Key = TypeVar("Key", bound=Hashable)


class Cache(Generic[Key]):
    """A cache with one row of numbers per key."""

    def __init__(self) -> None:
        self._rows: dict[Key, Any] = {}

    def get_or_compute(
        self, keys: Sequence[Key], compute: Callable[[list[Key]], FloatArray]
    ) -> list[FloatArray]:
        """Returns the row of each key.

        Args:
            keys: Keys in any order, with or without repetitions.
            compute: Returns the rows, ``(n, ...)``, of the distinct keys that are not cached.
        """
        missing = list(dict.fromkeys(key for key in keys if key not in self._rows))
        if missing:
            self._rows.update(zip(missing, compute(missing), strict=True))
        return [self._rows[key] for key in keys]
