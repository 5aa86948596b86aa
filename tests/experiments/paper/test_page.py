"""Promises of the page: it has the tables, the figures, and what is not known of the paper's."""

import dataclasses

from selfmodel.experiments.paper.page import page
from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.paper.reported import UNKNOWN
from selfmodel.experiments.paper.tables import costs, failures, summaries
from selfmodel.settings import Settings
from tests.helpers.paper_rows import evolution, recovery, trials

ROWS = [recovery(), recovery(case=7, correct=False), recovery(robot="hexapod", case=7)]
COSTS = costs(trials([2.0, 0.0, 1.0, 3.0]), evolution([1.0]))


def text(settings: Settings | None = None, found: tuple = COSTS) -> str:
    return page(settings or Settings(), failures(ROWS), summaries(ROWS), found)


def test_the_page_has_the_tables_and_figures():
    found = text()

    for number in (1, 5, 6):
        assert f"(figure-{number}.png)" in found
    assert "| 1 | a lower leg breaks off | `break:front_left_knee` |  |" in found
    assert (
        "| 7 | a | not restored | 1 of 1 | 0 of 1 | 2.00 | 0.50 | 2.00 | 1.00 | `intact` |" in found
    )
    assert f"| quadruped | {ON_ROBOT} | 10 | 1 | 0.50 |" in found
    assert "| quadruped | a | 2 | 1 | 1.50 |" in found


def test_the_page_has_what_the_paper_reports_and_what_is_not_known():
    found = text()

    assert "7, 8 of the quadruped; 4, 7, 10 of the hexapod" in found
    assert all(unknown in found for unknown in UNKNOWN)


def test_the_page_states_whether_the_search_budget_is_the_papers():
    assert "trials after the failing one: 3; the paper's." in text()
    assert "not the paper's." in text(dataclasses.replace(Settings(), generations=2))


def test_without_a_common_run_of_the_ways_there_is_no_sixth_figure():
    assert "figure-6" not in text(found=())


def test_the_tables_have_as_many_cells_in_every_row():
    widths: list[set[int]] = [set()]
    for line in text().splitlines():
        if line.startswith("|"):
            widths[-1].add(line.count("|"))
        elif widths[-1]:
            widths.append(set())

    assert [len(width) for width in widths if width] == [1, 1, 1, 1]
