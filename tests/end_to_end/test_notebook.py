"""The notebook of examples/ runs, and redraws the figures of the page that it is about."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from selfmodel.studies.statistics import Interval

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "examples" / "comparators.ipynb"
PAGE = ROOT / "docs" / "results" / "comparators.md"


def cells() -> list[dict[str, Any]]:
    return json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]


def compared() -> str:
    """The part of the page with differences: the table of all pairs, and the findings."""
    text = PAGE.read_text(encoding="utf-8")
    pairs = text.partition("## Which comparator is better")[2].partition("Bold: better.")[0]
    findings = text.partition("## Findings")[2].partition("## False alarms")[0]
    return pairs + findings


def both_ways(difference: Interval) -> list[str]:
    """A difference as the page states it, and that of the second method from the first."""
    ends = (difference.estimate, difference.low, difference.high)
    return [
        "{} ({} to {}".format(*(f"{round(value, 2) + 0:.2f}".replace("-", "−") for value in turned))  # noqa: RUF001
        for turned in (ends, (-ends[0], -ends[2], -ends[1]))
    ]


def test_the_notebook_holds_no_output_that_could_be_of_other_code():
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells())


@pytest.mark.opengl
def test_the_notebook_redraws_every_figure_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = tmp_path / "examples"
    folder.mkdir()
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    for cell in cells():
        if cell["cell_type"] == "code":
            lines = [line for line in cell["source"] if not line.startswith("%")]  # IPython's own
            exec(compile("".join(lines), cell["id"], "exec"), names)  # noqa: S102  # our notebook
    drawn = {path.name for path in (folder / "figures").iterdir()}
    shown = {Path(name).stem for name in re.findall(r"!\[.*\]\((.+)\)", PAGE.read_text())}

    assert drawn == {f"{name}.{suffix}" for name in shown for suffix in ("png", "pdf", "svg")}
    made = ("at_each_gap_too", "by_trials", "by_gap_alone", "without_position")
    known = {
        text
        for name in made
        for row in names[name].itertuples()
        for text in both_ways(Interval(row.difference, row.difference_low, row.difference_high))
    }
    stated = re.findall(r"−?\d\.\d\d \(−?\d\.\d\d to −?\d\.\d\d(?=[),])", compared())  # noqa: RUF001
    assert len(stated) >= 20
    assert set(stated) - known == set()
    assert len(names["pairs"]) == 4 * 21
    assert set(names["pairs"]["n"]) == {144, 432}
    assert (names["means"]["cells"] == 36).all()
