"""Tests of the command that measures the coverage of the intervals and the errors of the tests."""

import re
from pathlib import Path

import pytest

from benchmarks.paired_statistics import main

PAGE = Path(__file__).parents[2] / "docs" / "results" / "statistics.md"


def tables(text: str) -> dict[str, list[list[str]]]:
    """Returns the cells of each table of a text in Markdown, by the line of its heading."""
    found = {}
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        heading, _, *rows = block.splitlines()
        found[heading] = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    return found


def test_the_command_prints_every_table_of_simulated_studies_on_the_page(
    capsys: pytest.CaptureFixture[str],
):
    main(["--studies", "1"])

    printed = tables(capsys.readouterr().out)
    page = tables(PAGE.read_text(encoding="utf-8"))
    simulated = {heading: rows for heading, rows in page.items() if "dependence" in heading}
    assert len(simulated) == 3
    for heading, rows in simulated.items():
        names = [name.strip() for name in heading.strip("|").split("|")]
        conditions = names.index("dependence") + 1
        known = [row[:conditions] for row in printed[heading]]
        assert rows
        assert [row for row in rows if row[:conditions] not in known] == []
        for row in printed[heading]:
            assert all(re.fullmatch(r"\d+\.\d %", cell) for cell in row[conditions:]), row


def test_a_number_of_studies_below_one_is_refused(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main(["--studies", "0"])

    assert "--studies: expected 1 or more, got 0" in capsys.readouterr().err
