"""Promises of studies that are killed: the resumed study has the same files and the same table."""

from pathlib import Path

import pytest

from tests.experiments.kill_study import STUDIES, kill_and_resume, kills, unbroken


@pytest.mark.process
@pytest.mark.parametrize("study", STUDIES)
def test_a_killed_study_is_resumed_to_the_same_table(study: str, tmp_path: Path):
    reference = unbroken(study, tmp_path / "unbroken")

    for number, kill in enumerate([kill for kill in kills(18, 7) if kill.study == study][:4]):
        kill_and_resume(kill, reference, tmp_path / str(number))
