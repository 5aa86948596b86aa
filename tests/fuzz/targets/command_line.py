"""Values of options and arguments: notation, lists, numbers, names and paths."""

import contextlib
import io
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.cli import main
from selfmodel.cli.arguments import inputs
from selfmodel.comparators import COMPARATORS
from selfmodel.experiments.suite.bodies import bodies
from selfmodel.faults.registry import ALL_KINDS
from tests.fuzz.mutate.numbers import number_text, text
from tests.fuzz.seeds import biped, trial_log
from tests.fuzz.target import Case, Make, Target
from tests.logs.conftest import MJCF

LOG, MODEL, OUT = "log.mcap", "biped.xml", "out.mcap"
STEPS = 6

NOTATION = (
    *("break:left_hip_x", "jam:left_hip_y=0.1", "jam:left_hip_x", "sensor:left_touch", "neuron:0"),
    *("slope=0.1", "wind=1", "motor:left_hip_x=0.5", "break:left_hip_x+friction=0.3", "intact"),
    *("sensor:left_angle=x0.5", "break:front_left_knee", "roughness=0.01", "friction=0.4"),
)
NAMES = ("quadruped", "hexapod", "suite-walker", MODEL, LOG, "network", "cpg", "return")
LISTS = ("all", "1,2", "0,0.05", "1/1", "2/8", "before", "quadruped,hexapod", "swimmer,walker")
KINDS = tuple(kind.name for kind in ALL_KINDS)

SHORT = ("--population", "4", "--generations", "1", "--threads", "1")

TEMPLATES = (
    ("robots", "{name}"),
    ("robots", "{name}", "--json"),
    ("robots", MODEL, "--set", "{set}", "--json"),
    ("trial", MODEL, "-o", OUT, "--steps", "3", "--damage", "{notation}", "--json"),
    ("trial", MODEL, "-o", OUT, "--steps", "3", "--seed", "{number}", "--gap", "{number}"),
    ("trial", MODEL, "-o", OUT, "--steps", "3", "--controller", "{name}", "--neurons", "{number}"),
    ("trial", "{name}", "-o", "{path}", "--steps", "2", "--stage", "{list}"),
    ("trial", MODEL, "-o", OUT, "--steps", "3", "--kinds", "{kinds}", "--damage", "{notation}"),
    ("replay", LOG, "--hypothesis", "{notation}", "--kinds", "{kinds}", "--json", "--threads", "1"),
    ("replay", LOG, "--hypothesis", "{notation}", "--threads", "{small}"),
    ("replay", LOG, "--model", "{name}", "--threads", "1"),
    ("logs", "info", "{path}", "--json"),
    ("logs", "info", LOG, "{path}"),
    ("logs", "verify", LOG, "{path}"),
    ("logs", "salvage", LOG, "-o", "{path}"),
    ("diagnose", LOG, "--kinds", "{kinds}", *SHORT, "--seed", "{number}", "--json"),
    ("diagnose", LOG, "--comparator", "{comparator}", *SHORT),
    ("render", LOG, "-o", "{path}", "--hypothesis", "{notation}"),
    ("suite", "run", "--out", OUT, "--domains", "{name}", "--cases", "{text}", "--score", "{text}"),
    ("{name}", "{text}"),
)
"""Command lines; a word in braces is replaced by a value of its kind."""


def prepare(folder: Path) -> Make:
    """Returns the maker of command lines."""
    log = trial_log(folder / LOG, biped(), STEPS).read_bytes()
    files = {LOG: log, MODEL: MJCF.encode()}

    def make(rng: np.random.Generator) -> Case:
        if rng.random() < 0.5:
            call, value = _call(rng), _value("list", rng)
            return Case(f"{call.__name__} {value!r}", {}, partial(_check_call, call, value))
        template = TEMPLATES[rng.integers(len(TEMPLATES))]
        words = tuple(_value(w[1:-1], rng) if w.startswith("{") else w for w in template)
        return Case(repr(words), files, partial(_check_command, words))

    return make


def _call(rng: np.random.Generator) -> Callable[[str], object]:
    return CALLS[rng.integers(len(CALLS))]


def _texts(value: str) -> object:
    return inputs.texts("--list", value, ("a", "b"))


def _whole_numbers(value: str) -> object:
    return inputs.whole_numbers("--case", value, (1, 2))


def _numbers(value: str) -> object:
    return inputs.numbers("--gap", value)


def _share(value: str) -> object:
    return inputs.share("--only", value)


def _stage(value: str) -> object:
    return inputs.stage(value)


def _bodies(value: str) -> object:
    return bodies(inputs.texts("--domains", value), None)


def _case(value: str) -> object:
    return inputs.case_notation({1: "intact"}, None, value)


CALLS = (_texts, _whole_numbers, _numbers, _share, _stage, _bodies, _case)


def _check_call(call: Callable[[str], object], value: str) -> str:
    call(value)
    return "read"


def _value(kind: str, rng: np.random.Generator) -> str:
    """Returns a value of a kind; in many cases mutated, or of another kind."""
    if kind == "text" or rng.random() < 0.1:
        return _plain_text(rng)
    if kind == "number":
        return number_text(rng).replace("\x00", "")
    if kind == "set":
        keys = ("forward", "keyframe", "control_timestep", "touch", "angle", "ctrlrange")
        return f"{rng.choice(keys)}={_plain_text(rng)}"
    words, joint = WORDS[kind]
    return _spliced(words, joint, rng)


WORDS = {
    "notation": (NOTATION, "+"),
    "kinds": ((*KINDS, "all", "os:path", "selfmodel.faults:Hypothesis"), ","),
    "comparator": ((*COMPARATORS, "json:loads", "math:pi", "a:b", ":"), ""),
    "list": ((*LISTS, *NAMES, "1", "2"), ","),
    "name": ((*NAMES, "../x.xml", "a.xml", ".xml"), ""),
    "small": (("0", "1", "2", "-1", "x", "1025", ""), ""),
    "path": (("new.mcap", LOG, MODEL, ".", "..", "no/x.mcap", "x" * 300, "new.png", "a b"), ""),
}
"""Valid and invalid words of each kind, and the text between two of them."""


def _spliced(words: tuple[str, ...], joint: str, rng: np.random.Generator) -> str:
    chosen = [words[rng.integers(len(words))] for _ in range(int(rng.choice([1, 1, 2, 5])))]
    made = joint.join(chosen if joint else chosen[:1])
    kind = rng.random()
    if kind < 0.5:
        return made
    at = int(rng.integers(len(made) + 1))
    if kind < 0.7:
        return made[:at] + _plain_text(rng) + made[at:]
    if kind < 0.85:
        return made[:at] + made[at + 1 :]
    head, equals, _ = made.partition("=")
    return head + (equals or "=") + number_text(rng).replace("\x00", "")


def _plain_text(rng: np.random.Generator) -> str:
    """A text that can be an argument of a process: no zero byte, one argument's length."""
    return text(rng).replace("\x00", "")


def _check_command(words: tuple[str, ...]) -> str:
    """Runs a command in this process, and checks its outputs and its status."""
    output, errors = io.StringIO(), io.StringIO()
    sys.argv = ["selfmodel", *words]
    status: object = 0
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        try:
            main()
        except SystemExit as ended:
            status = ended.code or 0
    for path in Path().iterdir():
        if path.is_file() and path.name not in (LOG, MODEL):
            path.unlink()
    if status not in (0, 1, 2):
        raise AssertionError(f"status {status!r}")
    for name, stream in (("output", output), ("errors", errors)):
        odd = {c for c in stream.getvalue() if c != "\n" and not c.isprintable()}
        if odd:
            raise AssertionError(f"control characters in the {name}: {sorted(odd)}")
    if "Traceback" in errors.getvalue() or "Warning" in errors.getvalue():
        raise AssertionError(errors.getvalue())
    if status == 0 and "--json" in words and output.getvalue():
        json.loads(output.getvalue(), parse_constant=_refuse)
    return f"{words[0]} {status}"[:20]


def _refuse(name: str) -> None:
    raise AssertionError(f"{name} in JSON")


TARGET = Target("command-line", 4, prepare)
