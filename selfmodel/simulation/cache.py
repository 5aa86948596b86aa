"""What is computed once.

Each of the EAs has its own: a repair keeps the way that a run went, a diagnosis the losses of a
hypothesis in one trial. Behaviours are not kept, so a controller that was tried is simulated once
more for each trial it is compared with. Whatever else one of them has computed, it does not again.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from typing import Any, Generic, TypeVar

from selfmodel.arrays import FloatArray

Key = TypeVar("Key", bound=Hashable)


class Cache(Generic[Key]):
    """Remembers a row of numbers for every key it was ever asked for."""

    def __init__(self) -> None:
        self._known: dict[Key, Any] = {}

    def __len__(self) -> int:
        return len(self._known)

    def __iter__(self) -> Iterator[Key]:
        return iter(self._known)

    def __contains__(self, key: Key) -> bool:
        return key in self._known

    def __getitem__(self, key: Key) -> FloatArray:
        row: FloatArray = self._known[key]
        return row

    def update_from(self, other: "Cache[Key]", keys: Iterable[Key]) -> None:
        """Takes the rows of those keys that another knows."""
        self._known.update((key, other[key]) for key in keys if key in other)

    def get_or_compute(
        self, keys: Sequence[Key], compute: Callable[[list[Key]], FloatArray]
    ) -> list[FloatArray]:
        """Returns the row of each key.

        Args:
            keys: What is asked for; repetitions are fine.
            compute: From the keys not known yet, each once, to their rows, ``(n, ...)``.
        """
        unknown = list(dict.fromkeys(key for key in keys if key not in self._known))
        if unknown:
            self._known.update(zip(unknown, compute(unknown), strict=True))
        return [self._known[key] for key in keys]
