"""The parameters of the paper: run length, number of trials, both EAs; those of a repair apart."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from selfmodel.errors import InputError, check_name, real_number, whole_number

MAX_SETTINGS: Mapping[str, int] = MappingProxyType(
    {
        **dict.fromkeys(("population", "generations", "kept"), 10_000),
        **dict.fromkeys(("genes", "trials", "tournament"), 100),
        "steps": 10**6,
    }
)
"""Upper bounds of the settings. Settings may be read from an untrusted log, and larger values would
exhaust the memory."""


EA, STEPWISE, EA_STEPWISE = "ea", "stepwise", "ea+stepwise"
DIAGNOSTIC_SEARCHES = (EA_STEPWISE, STEPWISE, EA)
"""Searches of a diagnosis: the paper's EA, the local search, and the local search from the best of
the EA; the default is the first."""


ADDED = ("diagnostic_search", "max_simulated_steps")
"""Settings that logs of selfmodel 0.2 and before do not have: a log has them only if they are
set."""


@dataclass(frozen=True)
class Settings:
    """Run length, number of trials, and the search of a diagnosis.

    The parameters of the EA are those of the repair too, unless it has ``RepairSettings``.

    Source: the paper, sections III and IV. Its surviving text has lost digits; the values of
    ``steps``, ``population``, ``generations`` and ``survivors`` are reconstructed.

    Example:
        >>> import selfmodel
        >>> settings = selfmodel.Settings(generations=5).scaled(20)
        >>> print(settings.generations, settings.population, settings.survivors)
        5 20 10

    Attributes:
        steps: Control steps of a run.
        trials: Physical trials after the failing one, at most: a recovery that adapts a robot's
            controller ends with the first one in which the robot walks as before.
        population: Genomes in a generation.
        generations: Generations of an EA, the random first one included.
        survivors: Number of the best genomes that survive a generation.
        tournament: Number of survivors that compete to become a parent.
        mutation: Probability that a value of a child is drawn anew.
        crossovers: Number of pairs of children with one-point crossover.
        genes: Number of genes of a diagnostic genome, the largest number of faults.
        kept: Number of hypotheses that a diagnosis reports and that seed the next diagnosis.
        diagnostic_search: Search of a diagnosis, one of ``DIAGNOSTIC_SEARCHES``.
        max_simulated_steps: Control steps that a diagnosis may simulate for each of its trials, in
            its search and for its verdict, at least ``steps``; None for no limit.

    Raises:
        InputError: A setting is no number, out of range, or inconsistent with another setting. A
            number such as 1e3 is a whole one.
    """

    steps: int = 1000
    trials: int = 3
    population: int = 100
    generations: int = 30
    survivors: int = 50
    tournament: int = 3
    mutation: float = 0.01
    crossovers: int = 12
    genes: int = 4
    kept: int = 10
    diagnostic_search: str = EA_STEPWISE
    max_simulated_steps: int | None = None

    def __post_init__(self) -> None:
        check_name("diagnostic search", self.diagnostic_search, DIAGNOSTIC_SEARCHES)
        if (most := self.max_simulated_steps) is not None:
            steps = whole_number("max_simulated_steps", most, 10**6, least=self.steps)
            object.__setattr__(self, "max_simulated_steps", steps)
        self._check_numbers()
        if self.steps < 2:
            raise InputError(
                f"steps must be at least 2, so that there is a first and a last, got {self.steps}"
            )
        if self.population <= self.survivors:
            raise InputError(
                f"population must exceed the {self.survivors} survivors, got {self.population}: "
                f"leave it out and add .scaled({max(2, self.population)}) to your settings, which "
                f"keeps the others"
            )
        if not 0 <= self.crossovers <= (self.population - self.survivors) // 2:
            raise InputError(
                f"crossovers must be between 0 and the "
                f"{(self.population - self.survivors) // 2} pairs of children, "
                f"got {self.crossovers}"
            )

    def _check_numbers(self) -> None:
        for field in dataclasses.fields(self):
            if field.name in ADDED:
                continue
            number = real_number if field.name == "mutation" else whole_number
            value = number(field.name, getattr(self, field.name), getattr(Settings, field.name))
            object.__setattr__(self, field.name, value)
        for name in ("trials", "generations", "survivors", "tournament", "genes", "kept"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} must be at least 1, got {getattr(self, name)}")
        for name, most in MAX_SETTINGS.items():
            if getattr(self, name) > most:
                raise InputError(f"{name} must be at most {most}, got {getattr(self, name)}")
        if not 0 <= self.mutation <= 1:
            raise InputError(f"mutation is a probability in [0, 1], got {self.mutation}")

    def as_json(self) -> dict[str, Any]:
        """Returns the settings by name; those that came after format 0.2 only if they are set."""
        new = [name for name in ADDED if getattr(self, name) == getattr(Settings, name)]
        return {k: v for k, v in dataclasses.asdict(self).items() if k not in new}

    @property
    def evaluations(self) -> int:
        """Genomes that one EA evaluates: a population, then its children."""
        return self.population + (self.generations - 1) * (self.population - self.survivors)

    def of_repair(self, given: "RepairSettings | None") -> "Settings":
        """Returns the settings of the repair: these, with the parameters given for it."""
        return self if given is None else dataclasses.replace(self, **dataclasses.asdict(given))

    def scaled(self, population: int) -> "Settings":
        """Returns these settings for another population size, in the paper's proportions.

        Raises:
            InputError: ``population`` is below 2.
        """
        population = whole_number("population", population, 100)
        if population < 2:
            raise InputError(f"population must be at least 2, got {population}")
        survivors = population // 2
        return dataclasses.replace(
            self,
            population=population,
            survivors=survivors,
            crossovers=round((population - survivors) // 2 * 12 / 25),
        )


@dataclass(frozen=True)
class RepairSettings:
    """Parameters of the search of a repair, where they are not those of the diagnosis.

    The length of a run is of ``Settings`` alone.

    Example:
        >>> import selfmodel
        >>> print(selfmodel.RepairSettings(generations=60).scaled(20).survivors)
        10

    Attributes:
        population, generations, survivors, tournament, mutation, crossovers: As of ``Settings``.

    Raises:
        InputError: As for ``Settings``.
    """

    population: int = Settings.population
    generations: int = Settings.generations
    survivors: int = Settings.survivors
    tournament: int = Settings.tournament
    mutation: float = Settings.mutation
    crossovers: int = Settings.crossovers

    def __post_init__(self) -> None:
        checked = Settings().of_repair(self)
        for name in dataclasses.asdict(self):
            object.__setattr__(self, name, getattr(checked, name))

    def scaled(self, population: int) -> "RepairSettings":
        """Returns these settings for another population size; see ``Settings.scaled``."""
        whole = Settings().of_repair(self).scaled(population)
        return RepairSettings(**{name: getattr(whole, name) for name in dataclasses.asdict(self)})
