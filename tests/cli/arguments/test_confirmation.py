from pathlib import Path

import pytest

from selfmodel.cli.arguments.confirmation import confirm_time, duration
from selfmodel.sandbox.budget import Budget, BudgetError
from tests.helpers.command import selfmodel

TRIALS = Path(__file__).parents[2] / "data" / "logs-0.1" / "recovery" / "trials"
BEFORE, AFTER = (str(TRIALS / name) for name in ("00-before.mcap", "01-after.mcap"))
SLOW = {
    "diagnose": ("diagnose", BEFORE, AFTER, "--no-calibrate"),
    "replay": ("replay", AFTER),
    "calibrate": ("calibrate", BEFORE, "--out", "model.xml"),
    "render": ("render", AFTER, "--out", "strip.svg"),
}
LITTLE = ("--budget", "time=0.0001s")


def test_a_time_within_the_budget_needs_no_confirmation(capsys: pytest.CaptureFixture[str]):
    confirm_time(99.0, Budget(time=100), yes=False)

    assert capsys.readouterr().err == ""


def test_a_longer_time_is_refused_with_both_remedies():
    with pytest.raises(
        BudgetError, match=r"about 4 min, more than 3 min: --yes or --budget time=... to go on"
    ):
        confirm_time(240.0, Budget(), yes=False)


def test_a_longer_time_that_is_allowed_is_announced(capsys: pytest.CaptureFixture[str]):
    confirm_time(240.0, Budget(), yes=True)

    assert capsys.readouterr().err == "note: this takes about 4 min\n"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        *((0.034, "0.034 s"), (42, "42 s"), (119, "119 s"), (600, "10 min")),
        *((7200, "2 h"), (10**7, "116 days")),
    ],
)
def test_a_duration_has_its_natural_unit(seconds: float, text: str):
    assert duration(seconds) == text


@pytest.mark.parametrize("command", SLOW.values(), ids=SLOW)
def test_a_command_beyond_its_time_does_nothing_before_it_is_allowed(
    command: tuple[str, ...], tmp_path: Path
):
    done = selfmodel(*command, *LITTLE, cwd=tmp_path)

    assert done.returncode == 2
    assert "this takes about" in done.stderr
    assert "--yes or --budget time=" in done.stderr
    assert (done.stdout, list(tmp_path.iterdir())) == ("", [])


def test_with_yes_the_command_goes_on(tmp_path: Path):
    done = selfmodel("replay", AFTER, *LITTLE, "--yes", cwd=tmp_path)

    assert done.returncode == 0
    assert done.stderr.startswith("note: this takes about")
    assert "60 steps of quadruped" in done.stdout
