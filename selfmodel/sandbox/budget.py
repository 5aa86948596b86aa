"""Budget: memory and time that work on files may take, and the limits that follow from both."""

import re
from dataclasses import dataclass, fields

from selfmodel.errors import InputError


@dataclass(frozen=True)
class Budget:
    """Memory and time that a command may take for files from any source.

    Every limit on a file is a fixed fraction of one of the two, measured as the memory or the time
    that the unit takes in this package.

    Example:
        >>> import selfmodel
        >>> budget = selfmodel.Budget.parse("memory=4GB,time=30min")
        >>> print(budget.memory, budget.time)
        4000000000 1800.0

    Attributes:
        memory: Memory for the content of files, bytes.
        time: Estimated time from which a command requires confirmation, s.

    Raises:
        InputError: A value is not positive, or is too large for a limit of the system.
    """

    memory: int = 10**9
    time: float = 180.0

    def __post_init__(self) -> None:
        for name, most in _LARGEST.items():
            value = getattr(self, name)
            if not 0 < value <= most:
                raise InputError(
                    f"expected a {name} of the budget above 0 and at most {most:.0e}, got {value!r}"
                )

    @classmethod
    def parse(cls, text: str) -> "Budget":
        """Returns the budget of a text such as ``memory=4GB,time=30min``; both parts are optional.

        Raises:
            InputError: The text has another form.
        """
        values: dict[str, float] = {}
        for part in text.split(","):
            name, _, value = part.strip().partition("=")
            match = re.fullmatch(r"([0-9]{1,12}(?:\.[0-9]{1,6})?)\s*([A-Za-z]*)", value.strip())
            units = _UNITS.get(name, {})
            if match is None or match[2] not in units or name in values:
                raise InputError(
                    f"expected a budget such as memory=4GB,time=30min, got {text!r}: units are "
                    f"{', '.join(filter(None, _UNITS['memory']))} and "
                    f"{', '.join(filter(None, _UNITS['time']))}"
                )
            values[name] = float(match[1]) * units[match[2]]
        given = cls(**values)  # type: ignore[arg-type]  # memory becomes a whole number below
        return cls(int(given.memory), given.time)

    @property
    def file_bytes(self) -> int:
        """Largest size of one file, bytes; a quadruped's trial of 10 s takes 0.5 MB."""
        return self.memory // 8

    @property
    def unpacked_bytes(self) -> int:
        """Largest decompressed size of one file, bytes."""
        return self.memory * 3 // 8

    @property
    def chunk_bytes(self) -> int:
        """Largest decompressed size of a chunk of a trial log, bytes; those written have 256 KiB.

        Reading a chunk takes up to sixty times its size, for messages of 30 bytes.
        """
        return self.memory // 60

    @property
    def attached_bytes(self) -> int:
        """Largest size of all attachments of a log, bytes."""
        return self.memory // 30

    @property
    def other_bytes(self) -> int:
        """Largest size of all other records of a log, bytes: they take twenty times their size."""
        return self.memory // 30

    @property
    def json_bytes(self) -> int:
        """Largest JSON file, bytes: parsed and verified, it takes up to thirty times its size."""
        return self.memory // 60

    @property
    def records(self) -> int:
        """Largest number of messages of one file: each takes up to 1 kB."""
        return self.memory // 1000

    @property
    def frames(self) -> int:
        """Largest number of records outside the chunks of a log: a chunk has about ten indices."""
        return self.memory // 5000

    @property
    def names(self) -> int:
        """Largest number of names in a file: topics, channels, schemas, attachments, joints."""
        return self.memory // 100_000

    @property
    def model_text(self) -> int:
        """Largest text of a model, characters: MuJoCo takes up to 200 bytes for each."""
        return self.memory // 480

    @property
    def models_bytes(self) -> int:
        """Largest size of all models of a batch of simulations, bytes."""
        return self.memory // 2

    @property
    def file_seconds(self) -> float:
        """Processor time for reading one file, or for compiling one model, s."""
        return self.time / 18

    def __str__(self) -> str:
        """The text that ``parse`` reads."""
        return ",".join(f"{field.name}={getattr(self, field.name):.12g}" for field in fields(self))


_LARGEST = {"memory": 10**15, "time": 10**9}
"""Largest values: 1 PB and 30 years. The limits of a process and of a read are 63-bit integers."""

_UNITS = {
    "memory": {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "": 1},
    "time": {"s": 1, "min": 60, "h": 3600, "": 1},
}

DEFAULT_BUDGET = Budget()
"""Budget for a laptop: 1 GB, and 3 minutes before a command asks."""


class BudgetError(InputError):
    """Work on a file would exceed the budget; the message contains the option that raises it."""


def memory_error(what: str, budget: Budget) -> BudgetError:
    """Returns the error of work that takes too much memory, with its remedy.

    Args:
        what: Sentence about the work, without a full stop.
        budget: The budget.
    """
    return BudgetError(f"{what}: to go on, {more_memory(budget)}")


def more_memory(budget: Budget) -> str:
    """Returns the remedy of work that takes too much memory, as a clause."""
    return f"raise the memory with --budget memory=..., from {budget.memory / 1e9:.3g}GB"
