from pathlib import Path

import pytest

from tests.helpers.command import selfmodel


@pytest.mark.parametrize(
    "command",
    [
        ("ablate", "--table"),
        ("suite", "run", "--table"),
        ("paper", "--table"),
        ("compare", "study", "--table"),
    ],
)
def test_an_unknown_format_is_refused_before_a_study_is_run(
    command: tuple[str, ...], tmp_path: Path
):
    done = selfmodel(*command, "latx", "--out", "study", cwd=tmp_path)

    assert (done.returncode, done.stdout) == (2, "")
    assert "unknown table format 'latx': did you mean latex?" in done.stderr
    assert list(tmp_path.iterdir()) == []
