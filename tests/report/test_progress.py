import json
import math
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.events import SearchBegins
from selfmodel.report.progress import SEARCHES, ProgressRecorder, read_searches


def recorded() -> ProgressRecorder:
    recorder = ProgressRecorder(lambda _event: None)
    recorder(SearchBegins("repair", INTACT))
    recorder(Generation(1, 2, 0.1, 20, 1.0))
    recorder(Generation(2, 2, 0.30000000000000004, 30, 2.0))
    recorder(SearchBegins("diagnostic"))
    recorder(Generation(1, 2, -math.inf, 20, 1.0))
    return recorder


def test_every_event_is_handed_on():
    handed = []
    event = SearchBegins("diagnostic")

    ProgressRecorder(handed.append)(event)

    assert handed == [event]


def test_the_progress_is_read_back_from_the_folder(tmp_path: Path):
    recorder = recorded()

    recorder.write(tmp_path)

    assert read_searches(tmp_path) == recorder.searches
    assert [one.best for one in recorder.searches] == [(0.1, 0.30000000000000004), (-math.inf,)]
    assert [one.hypothesis for one in recorder.searches] == ["intact", ""]


def test_a_folder_without_progress_has_none(tmp_path: Path):
    assert read_searches(tmp_path) == ()


LONG = '[{"kind": "repair", "hypothesis": "", "best": [1%s], "evaluations": [1]}]' % ("0" * 400)


@pytest.mark.parametrize("text", ["{", "[1]", '[{"kind": "repair"}]', '[{"best": [NaN]}]', LONG])
def test_a_damaged_file_is_named(tmp_path: Path, text: str):
    (tmp_path / SEARCHES).write_text(text)

    with pytest.raises(InputError, match=r"searches\.json: expected the progress"):
        read_searches(tmp_path)


def test_a_recovery_leaves_its_progress(run: Path):
    searches = read_searches(run)

    assert [one.kind for one in searches] == ["repair", "diagnostic", "repair", "diagnostic"]
    assert all(0 < len(one.best) == len(one.evaluations) for one in searches)
    assert json.loads((run / SEARCHES).read_text())[2]["hypothesis"] != ""
