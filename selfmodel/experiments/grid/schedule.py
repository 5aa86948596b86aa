"""Order of the cells of a study: each after the cells that it needs, the first ones first."""

import heapq
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait

from selfmodel.errors import WorkError
from selfmodel.experiments.grid.cell import Cell
from selfmodel.experiments.grid.cell_runner import CellAnswer, Outcome
from selfmodel.experiments.grid.workers import Workers

Submit = Callable[[Cell], "Future[CellAnswer]"]

CHECK_SECONDS = 30.0
"""Wall time without an answer after which the workers are checked: one that cannot read a call,
such as one without selfmodel that joined a cluster later, may give no answer at all, s."""


def compute(
    cells: Mapping[str, Cell], submit: Submit, workers: Workers
) -> Iterator[tuple[Cell, CellAnswer]]:
    """Yields each cell with its end, in order of completion.

    A cell that needs a failed one fails without being computed. A cell whose worker exits is
    submitted again, in as many attempts as the workers have.

    Args:
        cells: Cells by place, each after those that it needs; a need that is not among them is
            finished.
        submit: Submits a cell to the executor of the workers.
        workers: The workers.

    Raises:
        InputError: A worker has other versions than the command, or none.
        WorkError: The executor takes no more cells.
    """
    order = {place: number for number, place in enumerate(cells)}
    missing = {
        place: {need.place for need in cell.needs.values()} & cells.keys()
        for place, cell in cells.items()
    }
    ready = [(order[place], place) for place in cells if not missing[place]]
    running: dict[Future[CellAnswer], str] = {}
    exits: Counter[str] = Counter()
    suspects: list[str] = []
    while ready or running or suspects:
        if not (ready or running):
            place = suspects.pop(0)
            running[_submitted(submit, cells[place])] = place
        while ready and len(running) < workers.at_once:
            _, place = heapq.heappop(ready)
            running[_submitted(submit, cells[place])] = place
        for future in _ended(running, workers):
            place = running.pop(future)
            answer = _answer(future, workers)
            exits[place] += answer is None
            left = workers.attempts - exits[place]
            if answer is None and left == 1 and workers.last_alone:
                suspects.append(place)
                continue
            if answer is None and left:
                heapq.heappush(ready, (order[place], place))
                continue
            answer = answer or _exited(future, exits[place])
            yield cells[place], answer
            dependents = [one for one, needed in missing.items() if place in needed]
            if answer.outcome is Outcome.DONE:
                for one in dependents:
                    missing[one].remove(place)
                    if not missing[one]:
                        heapq.heappush(ready, (order[one], one))
            else:
                yield from _without(cells[place], dependents, cells, missing)


def _without(
    failed: Cell, dependents: list[str], cells: Mapping[str, Cell], missing: dict[str, set[str]]
) -> Iterator[tuple[Cell, CellAnswer]]:
    """Yields the cells that need a failed one, and those that need them, as failed."""
    error = f"not computed: it needs {failed.key} {failed.part}, which failed"
    for place in dependents:
        if missing.pop(place, None) is not None:
            yield cells[place], CellAnswer(Outcome.SKIPPED, 0.0, error)
            further = [one for one, needed in missing.items() if place in needed]
            yield from _without(failed, further, cells, missing)


def _submitted(submit: Submit, cell: Cell) -> "Future[CellAnswer]":
    try:
        return submit(cell)
    except (BrokenExecutor, RuntimeError) as error:
        raise WorkError(
            f"the executor takes no more cells ({error}): finished cells are kept; the same "
            f"command continues"
        ) from error


def _ended(
    running: Mapping["Future[CellAnswer]", str], workers: Workers
) -> "set[Future[CellAnswer]]":
    """Returns the calls that have ended; none after ``CHECK_SECONDS``, with the workers checked.

    Raises:
        InputError: A worker has other versions than the command, or none.
    """
    done = wait(running, CHECK_SECONDS, FIRST_COMPLETED).done
    if not done:
        workers.check()
    return done


def _answer(future: "Future[CellAnswer]", workers: Workers) -> CellAnswer | None:
    """Returns the answer of a worker; None if the worker exited.

    Raises:
        InputError: A worker has other versions than the command, or none.
        WorkError: The executor has ended.
    """
    if future.cancelled():
        raise WorkError(
            "the executor has ended, such as the scheduler of a cluster: finished cells are kept; "
            "start it, and the same command continues"
        )
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, workers.exits):
        return None
    workers.check()
    line = " ".join(f"{type(error).__name__}: {error}".split())
    if isinstance(error, ImportError):  # those of a cell itself are in its answer
        refusal = (
            f"a worker cannot import what computes a cell ({line[:1000]}): install the same "
            f"versions of selfmodel, MuJoCo and numpy there as here"
        )
        return CellAnswer(Outcome.REFUSED, 0.0, refusal)
    return CellAnswer(Outcome.LOST, 0.0, f"the executor failed to compute it: {line[:1000]}")


def _exited(future: "Future[CellAnswer]", times: int) -> CellAnswer:
    reason = " ".join(str(future.exception()).split())
    error = f"lost with its worker in {times} attempts: {reason}; standard error may have the cause"
    return CellAnswer(Outcome.LOST, 0.0, error)
