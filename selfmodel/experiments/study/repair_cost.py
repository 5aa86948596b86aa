"""Expected cost of the repairs of a study, in simulated control steps."""

from collections.abc import Container, Sequence
from dataclasses import dataclass

from selfmodel.experiments.grid import Cell
from selfmodel.experiments.grid.cell import with_needs
from selfmodel.experiments.study.gaits import EVOLVE
from selfmodel.plugins import PAPER
from selfmodel.recovery.robust_repair import rollouts_of
from selfmodel.settings import Settings


@dataclass(frozen=True)
class RepairCost:
    """Expected cost of the repairs of a study; that of its diagnoses and trials is not in it.

    Attributes:
        gaits: Number of gaits to evolve.
        repairs: Number of repairs after a failure, at most.
        steps: Control steps that they simulate, at most.
        paper_steps: Control steps that as many of the paper's repairs simulate, at most.
    """

    gaits: int
    repairs: int
    steps: int
    paper_steps: int

    def __str__(self) -> str:
        ratio = self.steps / max(self.paper_steps, 1)
        return (
            f"gaits to evolve: {self.gaits}, repairs: {self.repairs}, of at most "
            f"{float(f'{self.steps:.2g}'):,.0f} control steps in simulation, {ratio:.1f} times as "
            f"many as of the paper's repair"
        )


def repair_cost(
    cells: Sequence[Cell],
    settings: Settings,
    repair: str,
    repairs_per_cell: int,
    finished: Container[str] = (),
) -> RepairCost:
    """Returns the expected cost of the repairs of a study.

    Args:
        cells: The cells of the runs, with the gaits that they need.
        settings: Parameters of the repairs.
        repair: Name of the repair.
        repairs_per_cell: Repairs in each cell of a run.
        finished: Places of the cells that are finished.
    """
    left = [cell for cell in cells if cell.place not in finished]
    gaits = sum(
        cell.function == EVOLVE and place not in finished
        for place, cell in with_needs(left).items()
    )
    repairs = repairs_per_cell * len(left)
    paper = (gaits + repairs) * settings.evaluations
    first, later = (rollouts_of(settings, known=known) for known in (False, True))
    rollouts = paper if repair == PAPER else gaits * first + repairs * later
    return RepairCost(gaits, repairs, rollouts * settings.steps, paper * settings.steps)
