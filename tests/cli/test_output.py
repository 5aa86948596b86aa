"""Text of a file, a name or an option begins no line of its own, and commands no terminal."""

import ast
import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Attachment, Channel, McapRecord, Metadata

from selfmodel.cli.output import counted_warnings, print_json, print_lines, print_notes
from selfmodel.cli.progress import grid_display
from selfmodel.cli.tables import WIDTH, folding, print_tables, show, text_console
from selfmodel.logs import records
from selfmodel.studies.grid import CellEnds, GridBegins
from tests.helpers.command import SMALL, Done, selfmodel
from tests.logs.conftest import MJCF
from tests.logs.edits import rewritten, says
from tests.logs.recordings.bags import write_bag
from tests.logs.recordings.conftest import MAPPING, recorded

FORGED = "ok: other.mcap"
EVIL = f"x\n{FORGED}\r{FORGED}\x85{FORGED}\u2028{FORGED}\x1b[2K\x08\x7f\u202eend\udc80"
"""In a file's name."""
EVIL_TEXT = EVIL.encode("utf-8", "replace").decode() + "\0"
"""In a file: UTF-8 has no surrogates."""
EVIL_NAME = f"x\n{FORGED}\r{FORGED}\u2028{FORGED}\u202eend"
"""In XML, which has no control characters but these."""

PICK = ("--kinds", "break,jam")


def check(done: Done) -> None:
    """Every line is one of ours, and every character of it can be printed."""
    said = done.stdout + done.stderr
    assert said.strip()
    for line in said.split("\n"):
        assert line.isprintable(), repr(line)
        assert not line.startswith(FORGED), line


def hostile(record: McapRecord) -> McapRecord:
    """Puts the text where a record of a log has one, and makes its digest right."""
    changes = {
        records.TRIAL: dict.fromkeys(("name", "robot"), EVIL_TEXT),
        records.RESULT: {"status": records.STOPPED, "reason": EVIL_TEXT},
        records.SOFTWARE: dict.fromkeys(("mujoco", EVIL_TEXT), EVIL_TEXT),
    }
    if isinstance(record, Metadata) and record.name in changes:
        texts = records.without_digest(record.name, record.metadata) | changes[record.name]
        return Metadata(record.name, records.with_digest(record.name, texts))
    return record


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a hostile log, a cut one, an MJCF file, a bag and its mapping."""
    folder = tmp_path_factory.mktemp("evil") / EVIL
    folder.mkdir()
    short = ("trial", "quadruped", "--steps", "80", "--stage")
    for stage, name in (("before", "before.mcap"), ("after", f"{EVIL}.mcap")):
        check(selfmodel(*short, stage, "--out", name, cwd=folder))
        rewritten(folder / name, hostile)
    data = (folder / f"{EVIL}.mcap").read_bytes()
    more = [
        Metadata(EVIL_TEXT, {}),
        Attachment(0, 0, EVIL_TEXT, "", b""),
        Channel(90, EVIL_TEXT, "", {}, 0),
    ]
    rewritten(folder / f"{EVIL}.mcap", lambda record: record, more=more)
    (folder / f"cut {EVIL}.mcap").write_bytes(data[: len(data) * 3 // 4])
    (folder / f"after {EVIL}.mcap").write_bytes(data)
    (folder / f"status {EVIL}.mcap").write_bytes(data)
    rewritten(folder / f"status {EVIL}.mcap", says(records.RESULT, status=EVIL_TEXT))
    twice = folder / f"twice {EVIL}.mcap"
    twice.write_bytes(data)
    rewritten(twice, lambda record: record, more=[Metadata(EVIL_TEXT, {})] * 2)
    escaped = EVIL_NAME.replace("\n", "&#10;").replace("\r", "&#13;")
    model = MJCF.replace("left_leg", escaped).replace("left_hip_x", f"hip {escaped}")
    (folder / f"{EVIL}.xml").write_text(model)
    (folder / "biped.xml").write_text(MJCF)
    items = [(f"{topic} {EVIL_NAME}", time, told) for topic, time, told in recorded(0.5)]
    write_bag(folder / "bag", items)
    quoted = json.dumps(EVIL_NAME)[1:-1]
    text = MAPPING.replace("/joint_states", f"/joint_states {quoted}")
    for topic in ("/commands", "/odom", "/imu", "/left_foot"):
        text = text.replace(topic, f"{topic} {quoted}")
    (folder / f"map {EVIL}.toml").write_text(text)
    (folder / "wrong.toml").write_text(text.replace("biped.xml", quoted))
    (folder / "key.toml").write_text(f'"{quoted}" = "{quoted}"\n{text}')
    (folder / f"{EVIL}.json").write_text(json.dumps({"diagnosis": [{"hypothesis": EVIL_TEXT}]}))
    return folder


LOGS = [f"{one}{EVIL}.mcap" for one in ("", "cut ", "twice ", "status ", "no ")]
LOG, MODEL = f"{EVIL}.mcap", f"{EVIL}.xml"

COMMANDS = [
    ("logs", "info", *LOGS),
    ("logs", "verify", *LOGS),
    ("logs", "salvage", f"cut {LOG}", "-o", f"saved {LOG}"),
    ("logs", "import", "bag", "--suggest", "--robot", MODEL),
    ("logs", "import", "bag", "--mapping", f"map {EVIL}.toml", "-o", f"imported {LOG}"),
    ("logs", "import", "bag", "--mapping", "wrong.toml", "-o", "new.mcap"),
    ("logs", "import", "bag", "--mapping", "key.toml", "-o", "new.mcap"),
    ("logs", "import", f"no {EVIL}", "--mapping", f"map {EVIL}.toml", "-o", "new.mcap"),
    ("replay", LOG, "--out", f"{EVIL}.svg"),
    ("replay", LOG, "--hypothesis", EVIL),
    ("replay", LOG, "--robot", MODEL),
    ("render", LOG, "--out", f"strip {EVIL}.svg", "--pictures", "2"),
    ("render", LOG, "--out", "new.svg", "--diagnosis", f"{EVIL}.json"),
    ("diagnose", f"after {LOG}", "before.mcap", *SMALL, *PICK),
    ("diagnose", LOG, "--comparator", EVIL),
    ("calibrate", "before.mcap", "-o", f"fitted {MODEL}"),
    ("robots", MODEL),
    ("robots", MODEL, "--json"),
    ("robots", MODEL, "--set", f"{EVIL}={EVIL}"),
    ("trial", MODEL, "--steps", "20", "--out", f"own {LOG}"),
    ("trial", "quadruped", "--damage", EVIL, "--out", "new.mcap"),
    ("recover", "quadruped", "--damage", EVIL, "--next-trial", EVIL),
    ("recover", MODEL, "--damage", "friction=0.4", *SMALL, "--steps", "60", "--out", f"run {EVIL}"),
    ("ablate", "--out", EVIL, "--robots", EVIL),
    (EVIL,),
    ("robots", f"--{EVIL}"),
]


ROOT = Path(__file__).parents[2]
WAYS_OUT = {"typer.echo": "output.py", "Console": "tables.py", "print": ""}
"""What writes to the terminal, and the one file that calls it."""


def test_text_leaves_through_one_way_only():
    for path in (ROOT / "selfmodel" / "cli").rglob("*.py"):
        tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        called = {ast.unparse(node.func) for node in tree if isinstance(node, ast.Call)}
        assert not {way for way in called if WAYS_OUT.get(way, path.name) != path.name}, path


def test_a_line_is_one_line_and_can_be_printed(capsys: pytest.CaptureFixture[str]):
    print_lines("a line", EVIL)
    print_notes(EVIL)
    told = capsys.readouterr()

    assert told.out.split("\n") == ["a line", repr(EVIL)[1:-1], ""]
    assert told.err == f"{repr(EVIL)[1:-1]}\n"


def test_json_is_exact_and_without_control_characters(capsys: pytest.CaptureFixture[str]):
    print_json({EVIL: [EVIL, EVIL_TEXT]}, indent=None)
    (line, end) = capsys.readouterr().out.split("\n")

    assert (line.isprintable(), line.isascii(), end) == (True, True, "")
    assert json.loads(line) == {EVIL: [EVIL, EVIL_TEXT]}


def test_tables_and_progress_print_names_as_they_are(capsys: pytest.CaptureFixture[str]):
    rows = [["[red]:smile:" + EVIL_NAME, EVIL]]
    show(("a", "b"), rows)
    print_tables(folding(("a", "b"), rows, title="t" + EVIL))
    end = CellEnds(name=EVIL, number=1, total=2, seconds=0.0, error=EVIL)
    with grid_display() as on_event:
        on_event(end)
    told = capsys.readouterr()

    check(Done((), 0, told.out, told.err))
    assert "[red]:smile:x" in told.out


@pytest.mark.search
@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda words: ascii(" ".join(words[:2])))
def test_no_command_prints_a_forged_line(folder: Path, arguments: tuple[str, ...]):
    check(selfmodel(*arguments, cwd=folder))


@pytest.mark.parametrize(
    ("done", "left", "seconds", "text"),
    [
        (10, 35, 600.0, "60 an hour, 0 h 35 min left"),
        (1, 200, 1800.0, "2 an hour, 100 h 00 min left"),
        (3, 1, 0.5, "21600 an hour, 0 h 01 min left"),
        (3, 0, 5.0, ""),
        (0, 3, 5.0, ""),
    ],
)
def test_the_pace_of_a_study_is_that_of_this_call_and_the_time_left(
    done: int, left: int, seconds: float, text: str
):
    assert CellEnds("run-1", done, done + left, 0.0, None, done / seconds).pace == text


def test_off_a_terminal_every_cell_is_a_line_with_rate_and_time_left(
    capsys: pytest.CaptureFixture[str],
):
    with grid_display() as on_event:
        on_event(GridBegins(total=3, finished=1))
        on_event(CellEnds("run-1 auto", 2, 3, 1.25, None, rate=0.1))
        on_event(CellEnds("run-2 auto", 3, 3, 1.25, "it diverged", rate=0.1))
    before, done, failed = capsys.readouterr().err.splitlines()

    assert before == "1 of 3 were done before"
    assert done == "[2/3] run-1 auto: done in 1.2 s; 360 an hour, 0 h 01 min left"
    assert failed == "[3/3] run-2 auto: failed: it diverged"


@pytest.mark.parametrize(("columns", "width"), [("0", WIDTH), ("40", 40)])
def test_a_terminal_without_a_width_has_a_usual_one(
    monkeypatch: pytest.MonkeyPatch, columns: str, width: int
):
    monkeypatch.setenv("COLUMNS", columns)

    assert text_console().width == width


def overflow() -> None:
    with np.errstate(over="warn"):
        np.square(np.array([1e308]))


def test_each_warning_of_a_library_is_one_sentence_with_its_number_even_before_an_error(
    capsys: pytest.CaptureFixture[str],
):
    with pytest.raises(SystemExit), counted_warnings():  # noqa: PT012  # what fails is the block
        for _ in range(37):
            overflow()
        warnings.warn("a file is\nold \x1b[2J", RuntimeWarning, stacklevel=1)
        assert capsys.readouterr() == ("", "")
        raise SystemExit(2)
    out, err = capsys.readouterr()

    assert out == ""
    assert "note: Python warned 37 times: RuntimeWarning: overflow encountered in square\n" in err
    assert "note: Python warned 1 time: RuntimeWarning: a file is old \\x1b[2J\n" in err
    assert ".py" not in err
    with pytest.raises(RuntimeWarning):  # warnings are as before
        overflow()
