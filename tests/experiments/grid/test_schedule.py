"""Promises of the order of cells: needs first, lost workers tried again, nothing twice."""

import dataclasses
import threading
from concurrent.futures import BrokenExecutor, Future

import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError, WorkError
from selfmodel.experiments.grid.cell import Cell, with_needs
from selfmodel.experiments.grid.cell_runner import CellAnswer, Outcome
from selfmodel.experiments.grid.process_workers import ProcessWorkers
from selfmodel.experiments.grid.schedule import compute
from selfmodel.experiments.grid.workers import Workers

DONE = CellAnswer(Outcome.DONE, 1.0)


def cell(number: int, *needs: Cell) -> Cell:
    return Cell("m:f", f"cell-{number:03d}", {}, number, needs={one.key: one for one in needs})


def workers(at_once: int, attempts: int = 3, *, last_alone: bool = False) -> Workers:
    """Workers by their number; the test submits the cells itself."""
    return Workers(ProcessWorkers(1), at_once, attempts=attempts, last_alone=last_alone)


def answered(answer: CellAnswer | Exception | None) -> "Future[CellAnswer]":
    """A future that has ended; cancelled without an answer."""
    future: Future[CellAnswer] = Future()
    if answer is None:
        future.cancel()
        future.set_running_or_notify_cancel()
    elif isinstance(answer, Exception):
        future.set_exception(answer)
    else:
        future.set_result(answer)
    return future


@given(st.lists(st.sets(st.integers(0, 11)), min_size=1, max_size=12), st.integers(1, 4))
def test_each_cell_is_submitted_once_and_after_its_needs(needs: list[set[int]], at_once: int):
    cells: list[Cell] = []
    for number, needed in enumerate(needs):
        cells.append(cell(number, *(cells[one] for one in needed if one < number)))
    submitted: list[str] = []
    ended: set[str] = set()

    def submit(one: Cell) -> "Future[CellAnswer]":
        assert {need.key for need in one.needs.values()} <= ended
        submitted.append(one.key)
        return answered(DONE)

    for one, answer in compute(with_needs(cells), submit, workers(at_once)):
        assert answer is DONE
        ended.add(one.key)

    assert sorted(submitted) == sorted(one.key for one in cells)


def test_the_first_cells_are_first_and_a_need_follows_its_place():
    needed = cell(1)
    order = [cell(0), cell(2, needed), cell(3)]
    submitted: list[int] = []

    def submit(one: Cell) -> "Future[CellAnswer]":
        submitted.append(one.seed)
        return answered(DONE)

    assert len([*compute(with_needs(order), submit, workers(1))]) == 4
    assert submitted == [0, 1, 2, 3]


@pytest.mark.parametrize("exits", range(4))
def test_a_cell_whose_worker_exits_is_tried_again_a_few_times(exits: int):
    left = [BrokenExecutor("its process ended with status 9")] * exits

    def submit(one: Cell) -> "Future[CellAnswer]":
        return answered(left.pop() if left and one.seed == 0 else DONE)

    ends = {
        one.seed: answer
        for one, answer in compute(with_needs([cell(0), cell(1)]), submit, workers(1))
    }

    assert ends[1] == DONE
    if exits < 3:
        assert ends[0] == DONE
    else:
        assert ends[0].outcome is Outcome.LOST
        assert "in 3 attempts: its process ended with status 9" in str(ends[0].error)


def test_a_worker_that_cannot_import_the_call_is_refused():
    error = ModuleNotFoundError("No module named 'selfmodel'")

    ((_, answer),) = compute(with_needs([cell(0)]), lambda _: answered(error), workers(1))

    assert answer.outcome is Outcome.REFUSED
    assert "cannot import what computes a cell (ModuleNotFoundError" in str(answer.error)


@pytest.mark.parametrize(
    "call",
    [answered(AttributeError("run_cell")), Future()],
    ids=["a failed call", "a call without an answer"],
)
def test_the_workers_are_checked_after(call: "Future[CellAnswer]", monkeypatch: pytest.MonkeyPatch):
    def check() -> None:
        raise InputError("the worker at host has selfmodel 0.0.1")

    monkeypatch.setattr("selfmodel.experiments.grid.schedule.CHECK_SECONDS", 0.1)
    checked = dataclasses.replace(workers(1), check=check)
    ends = compute(with_needs([cell(0)]), lambda _: call, checked)

    with pytest.raises(InputError, match=r"at host has selfmodel 0\.0\.1"):
        next(ends)


def test_where_workers_share_cells_the_last_attempt_has_no_other_beside_it():
    """All cells of a worker are lost with it, not only the one that ends it."""
    cells = [cell(0), cell(1), cell(2)]
    first: list[Future[CellAnswer]] = []

    def submit(one: Cell) -> "Future[CellAnswer]":
        if len(first) == 3:
            assert all(future.done() for future in first)
            return answered(BrokenExecutor("killed") if one.seed == 0 else DONE)
        first.append(Future())
        if len(first) == 3:
            first[0].set_exception(BrokenExecutor("killed"))
            first[1].set_exception(BrokenExecutor("killed"))
            threading.Timer(0.1, first[2].set_result, [DONE]).start()
        return first[-1]

    ends = compute(with_needs(cells), submit, workers(3, attempts=2, last_alone=True))

    assert {one.seed: end.outcome for one, end in ends} == {
        0: Outcome.LOST,
        1: Outcome.DONE,
        2: Outcome.DONE,
    }


def test_where_a_worker_has_one_cell_no_attempt_waits_for_others():
    held: list[Future[CellAnswer]] = []
    exits = [BrokenExecutor("its job ended")] * 2

    def submit(one: Cell) -> "Future[CellAnswer]":
        if one.seed == 0 and exits:
            return answered(exits.pop())
        if one.seed == 1:
            held.append(Future())
            return held[0]
        held[0].set_result(DONE)
        return answered(DONE)

    ends = compute(with_needs([cell(1), cell(0)]), submit, workers(2))
    assert {one.seed for one, _ in ends} == {0, 1}


def test_what_needs_a_failed_cell_fails_too_once():
    first = cell(0)
    second = cell(1, first)
    third = cell(2, first, second)
    failed = CellAnswer(Outcome.FAILED, 1.0, "diverged")

    def submit(one: Cell) -> "Future[CellAnswer]":
        return answered(failed if one is first else DONE)

    ends = compute(with_needs([third, cell(3)]), submit, workers(2))

    assert sorted((one.seed, answer.outcome.value) for one, answer in ends) == [
        (0, "failed"),
        (1, "skipped"),
        (2, "skipped"),
        (3, "done"),
    ]


def test_an_error_of_the_executor_is_that_of_its_cell():
    ends = [
        *compute(
            with_needs([cell(0)]), lambda _: answered(ValueError("no such module")), workers(1)
        )
    ]

    assert ends[0][1].outcome is Outcome.LOST
    assert "failed to compute it: ValueError: no such module" in str(ends[0][1].error)


def test_an_executor_that_has_ended_ends_the_grid_with_the_remedy():
    with pytest.raises(WorkError, match=r"has ended, .*finished cells are kept"):
        [*compute(with_needs([cell(0)]), lambda _: answered(None), workers(1))]

    def refuse(_one: Cell) -> "Future[CellAnswer]":
        raise BrokenExecutor("it is broken")

    with pytest.raises(WorkError, match=r"takes no more cells \(it is broken\).*same command"):
        [*compute(with_needs([cell(0)]), refuse, workers(1))]


def test_what_a_cell_needs_is_part_of_its_place():
    assert cell(1, cell(0)).place != cell(1).place
