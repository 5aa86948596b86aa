from pathlib import Path

import pytest

from selfmodel.logs import robots
from selfmodel.logs.verify import verify
from selfmodel.sandbox.budget import Budget


def test_the_model_is_loaded_within_the_budget_of_the_verification(
    log: Path, monkeypatch: pytest.MonkeyPatch
):
    given = []
    monkeypatch.setattr(robots, "robot_of", lambda _, budget=None: given.append(budget))
    budget = Budget(memory=3 * 10**9)

    verify(log, budget=budget)

    assert given == [budget]
