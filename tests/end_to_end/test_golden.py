"""The golden set notices a difference between two versions, and takes nothing else for one."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks.golden.__main__ import main

RECORD = {
    "diagnoses/one:diagnose": {
        "exit": 0,
        "files": {"trial.mcap": {"/joint_states": "0" * 12}},
        "output": {
            "verdict": "explained",
            "diagnosis": [{"hypothesis": "friction=0.4", "distance": 0.1}],
            "kinds": ["break", "jam"],
        },
    }
}


def output(record: dict[str, Any]) -> dict[str, Any]:
    return record["diagnoses/one:diagnose"]["output"]


def topics(record: dict[str, Any]) -> dict[str, str]:
    return record["diagnoses/one:diagnose"]["files"]["trial.mcap"]


@pytest.mark.parametrize(
    ("change", "status", "said"),
    [
        (lambda _new: None, 0, "1 same"),
        (lambda new: output(new).update(new_key=1), 0, "1 same"),
        (lambda new: output(new).update(verdict="ambiguous"), 1, "explained became ambiguous"),
        (lambda new: output(new)["diagnosis"][0].update(distance=-0.1), 1, "0.1 became -0.1"),
        (lambda new: output(new)["diagnosis"][0].update(distance=0.1 + 1e-12), 0, "same to 1e-9"),
        (lambda new: output(new)["kinds"].remove("jam"), 1, "kinds"),
        (lambda new: output(new).pop("verdict"), 1, "verdict: missing"),
        (lambda new: topics(new).update({"/joint_states": "1" * 12}), 1, "became 111111111111"),
        (lambda new: topics(new).clear(), 1, "missing"),
        (lambda new: new.clear(), 1, "only in"),
    ],
)
def test_a_difference_is_named_and_ends_with_status_one(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    change: Callable[[dict[str, Any]], None],
    *,
    status: int,
    said: str,
):
    new = copy.deepcopy(RECORD)
    change(new)
    for name, record in (("old.json", RECORD), ("new.json", new)):
        (tmp_path / name).write_text(json.dumps(record))
    files = [str(tmp_path / name) for name in ("old.json", "new.json")]
    monkeypatch.setattr("sys.argv", ["golden", "compare", *files])
    with pytest.raises(SystemExit) as end:
        main()

    assert (end.value.code, said in capsys.readouterr().out) == (status, True)
