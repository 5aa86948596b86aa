"""``selfmodel ablate``: the table of the scores, on the terminal and as a file."""

import json
from importlib import import_module
from pathlib import Path

import pytest

from selfmodel.experiments.ablation import AblationResults
from selfmodel.experiments.ablation.scores import summarise
from tests.experiments.comparison.test_outcomes import ablation_rows
from tests.helpers.command import selfmodel


def test_the_printed_scores_are_a_table_in_the_format_of_choice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    module = import_module("selfmodel.cli.studies.ablate")
    rows = tuple(ablation_rows())
    results = AblationResults(rows, summarise(rows), (Path("out/results.csv"),))
    monkeypatch.setattr(module.grid_display, "run_shown", lambda *_, **__: ())
    monkeypatch.setattr(module, "write_results", lambda _folder: results)

    command = ("ablate", "--robots", "quadruped", "--table", "markdown", "--out", "out")
    done = selfmodel(*command, cwd=tmp_path)
    told = selfmodel(*command, "--json", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert json.loads(told.stdout)["files"] == ["out/results.csv", "out/tables/scores.md"]
    assert "12 of 12" in done.stdout
    assert done.stdout.splitlines()[-1] == "out/tables/scores.md"
    lines = (tmp_path / "out" / "tables" / "scores.md").read_text().splitlines()
    assert lines[0] == "| robot | gap | comparator | trials | right | right, % | time |"
    assert lines[2] == "| quadruped | 0.05 | a | 1 | 12 of 12 | 100 (76 to 100) | - |"
