"""A small recovery of which reports are made, and its subject."""

from pathlib import Path

import pytest

from selfmodel.report.content import shots_of
from selfmodel.report.scene import Shot
from selfmodel.report.subject import Subject, subject_of_run
from tests.helpers.calibration import coarse
from tests.helpers.command import selfmodel

RECOVER = (
    *("recover", "quadruped", "--case", "2", "--gap", "0.1", "--population", "6"),
    *("--generations", "1", "--steps", "60", "--trials", "1", "--repair", "paper"),
    *("--kinds", "break,jam", "--out", "run"),
)


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a small recovery."""
    folder = tmp_path_factory.mktemp("report")
    with coarse():
        done = selfmodel(*RECOVER, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "run"


@pytest.fixture(scope="session")
def subject(run: Path) -> Subject:
    with coarse():
        return subject_of_run(run, threads=1)


@pytest.fixture(scope="session")
def shots(subject: Subject) -> tuple[Shot, ...]:
    return shots_of(subject)
