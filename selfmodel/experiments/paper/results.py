"""Results of the paper's experiment: collected from its folder, as tables, figures and a page."""

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.experiments.grid import FinishedPart, finished
from selfmodel.experiments.paper import figures, robot_figure
from selfmodel.experiments.paper.page import page
from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.paper.rows import EvolutionRow, RecoveryRow, TrialRow, run_of
from selfmodel.experiments.paper.tables import (
    CaseSummary,
    Cost,
    Failure,
    costs,
    failures,
    last_costs,
    summaries,
)
from selfmodel.experiments.study.drawing import files_of
from selfmodel.experiments.study.files import Row, as_csv, as_dicts, as_rows, write_files
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS


@dataclass(frozen=True)
class PaperResults:
    """Results of the experiment and their files.

    Attributes:
        settings: Parameters of all runs; None without a finished run.
        failures: Table I.
        summaries: Table II.
        recoveries: All recoveries in the folder.
        trials: Their physical trials.
        evolution: Generations of the evolutions on the robot.
        files: Paths of the page, the tables and the figures.
    """

    settings: Settings | None
    failures: tuple[Failure, ...]
    summaries: tuple[CaseSummary, ...]
    recoveries: tuple[RecoveryRow, ...]
    trials: tuple[TrialRow, ...]
    evolution: tuple[EvolutionRow, ...]
    files: tuple[Path, ...] = ()

    @property
    def costs(self) -> tuple[Cost, ...]:
        """Restored function by way and number of physical trials."""
        return costs(self.trials, self.evolution)

    def as_dict(self) -> dict[str, Any]:
        """Returns the tables and their rows as JSON."""
        return {
            "settings": self.settings and dataclasses.asdict(self.settings),
            "table_1": as_dicts(self.failures),
            "table_2": as_dicts(self.summaries),
            "costs": as_dicts(last_costs(self.costs)),
            "recoveries": as_dicts(self.recoveries),
            "trials": as_dicts(self.trials),
        }


def write_results(folder: Path) -> PaperResults:
    """Writes page, tables and figures of all finished runs in the folder of an experiment.

    Without a finished run, nothing is written.

    Raises:
        InputError: A file in the folder is damaged.
        OSError: The results cannot be written.
    """
    found = collect(folder)
    if not found.recoveries:
        return found
    return dataclasses.replace(found, files=write_files(folder, _files(found)))


def collect(folder: Path) -> PaperResults:
    """Returns all results in the folder of an experiment, without writing them.

    Raises:
        InputError: A file in the folder is damaged.
    """
    parts = [*finished(folder / "runs")]
    made = [part for part in parts if part.part != ON_ROBOT]
    recoveries = _rows(RecoveryRow, made, "recoveries")
    return PaperResults(
        settings=Settings(**parts[0].parameters["shared"]["settings"]) if parts else None,
        failures=failures(recoveries),
        summaries=summaries(recoveries),
        recoveries=recoveries,
        trials=_rows(TrialRow, made, "trials"),
        evolution=_rows(
            EvolutionRow, [part for part in parts if part.part == ON_ROBOT], "evolution"
        ),
    )


def _rows(record: type[Row], parts: Sequence[FinishedPart], name: str) -> tuple[Row, ...]:
    """Returns the rows of all parts, robots in the paper's order, then by case and seed.

    The rows of the paper's comparator are the first of those of a run.
    """
    ordered = sorted(parts, key=lambda part: part.part != FORWARD_DISPLACEMENT.name)  # stable
    rows = [
        row
        for part in ordered
        for row in as_rows(record, dataclasses.replace(part, result=part.result[name]))
    ]
    return tuple(sorted(rows, key=_order))


def _order(row: Any) -> tuple[int, int, int]:  # noqa: ANN401  # a row of one of three kinds
    robot, case, seed = run_of(row)
    return list(ROBOTS).index(robot), case, seed


def _files(found: PaperResults) -> dict[str, bytes]:
    robots = dict.fromkeys(row.robot for row in found.recoveries)
    text = json.dumps(found.as_dict(), indent=1, allow_nan=False)
    return {
        **files_of("figure-1", robot_figure.of_robots([ROBOTS[name].robot() for name in robots])),
        **files_of("figure-5", figures.by_trial(found.trials)),
        # Comparators that have no run in common cannot be compared.
        **(files_of("figure-6", figures.by_cost(found.costs)) if found.costs else {}),
        "table-1.csv": as_csv(Failure, found.failures).encode(),
        "table-2.csv": as_csv(CaseSummary, found.summaries).encode(),
        "costs.csv": as_csv(Cost, found.costs).encode(),
        "recoveries.csv": as_csv(RecoveryRow, found.recoveries).encode(),
        "trials.csv": as_csv(TrialRow, found.trials).encode(),
        "evolution.csv": as_csv(EvolutionRow, found.evolution).encode(),
        "results.json": f"{text}\n".encode(),
        "paper.md": page(found.settings, found.failures, found.summaries, found.costs).encode(),
    }
