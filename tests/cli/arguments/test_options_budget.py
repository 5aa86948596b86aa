"""Every command that reads files of others has one budget, with one spelling."""

from pathlib import Path

import pytest

from selfmodel.cli.arguments.options import DEFAULT_BUDGET
from selfmodel.sandbox import budget
from tests.helpers.command import selfmodel

LOG = Path(__file__).parents[2] / "data" / "logs-0.1" / "recovery" / "trials" / "00-before.mcap"
READERS = {
    "diagnose": ("diagnose", str(LOG)),
    "replay": ("replay", str(LOG)),
    "calibrate": ("calibrate", str(LOG), "--out", "model.xml"),
    "render": ("render", str(LOG), "--out", "strip.svg"),
    "info": ("logs", "info", str(LOG)),
    "verify": ("logs", "verify", str(LOG)),
    "salvage": ("logs", "salvage", str(LOG), "--out", "new.mcap"),
}


def test_the_budget_on_the_help_page_is_the_default():
    assert budget.Budget.parse(DEFAULT_BUDGET) == budget.DEFAULT_BUDGET


@pytest.mark.parametrize("command", READERS.values(), ids=READERS)
def test_a_log_beyond_the_budget_is_refused_with_the_option_that_raises_it(
    command: tuple[str, ...], tmp_path: Path
):
    done = selfmodel(*command, "--budget", "memory=100kB", cwd=tmp_path)

    assert done.returncode != 0
    assert "--budget memory=" in done.stdout + done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", READERS.values(), ids=READERS)
def test_a_wrong_budget_is_an_error_of_usage(command: tuple[str, ...], tmp_path: Path):
    done = selfmodel(*command, "--budget", "memory=lots", cwd=tmp_path)

    assert done.returncode == 2
    assert "expected a budget such as memory=4GB,time=30min" in " ".join(done.stderr.split())
