"""Promises of the display of a study."""

import pytest

from selfmodel.cli.output.grid_display import grid_display, pace
from selfmodel.studies.grid import CellEnds, GridBegins


@pytest.mark.parametrize(
    ("done", "left", "seconds", "text"),
    [
        (10, 35, 600.0, "60 an hour, 0 h 35 min left"),
        (1, 200, 1800.0, "2 an hour, 100 h 00 min left"),
        (3, 1, 0.5, "21600 an hour, 0 h 01 min left"),
        (3, 0, 5.0, ""),
        (0, 3, 5.0, ""),
    ],
)
def test_the_pace_is_the_rate_of_this_call_and_the_time_that_is_left(
    done: int, left: int, seconds: float, text: str
):
    assert pace(done, left, seconds) == text


def test_off_a_terminal_every_cell_is_a_line_with_rate_and_time_left(
    capsys: pytest.CaptureFixture[str],
):
    with grid_display() as on_event:
        on_event(GridBegins(total=3, finished=1))
        on_event(CellEnds("run-1 auto", 2, 3, 1.25, None))
        on_event(CellEnds("run-2 auto", 3, 3, 1.25, "it diverged"))
    before, done, failed = capsys.readouterr().err.splitlines()

    assert before == "1 of 3 were done before"
    assert done.startswith("[2/3] run-1 auto: done in 1.2 s; ")
    assert done.endswith(" an hour, 0 h 01 min left")
    assert failed == "[3/3] run-2 auto: failed: it diverged"
