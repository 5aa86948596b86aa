"""The commands whose results ``benchmarks.golden`` records and compares.

A scenario is a list of commands that run one after the other in an empty folder. The first part of
its name is the part of the comparison that it belongs to.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import gymnasium

ROOT = Path(__file__).parents[2]
BANK = ROOT / "benchmarks" / "bank"
"""Evolved gaits, the same files for every version."""

DATA = ROOT / "tests" / "data" / "logs-0.1"
"""Logs of version 0.1."""

SAMPLES = ROOT.parent / "shared" / "samples"
"""Recordings that are not in the repository; scenarios of those that are missing are left out."""

MODELS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
PARTS = (
    *("trials", "replays", "models", "imports", "calibrations", "diagnoses", "foreign"),
    *("recoveries", "commands"),
)
ROBOTS = ("quadruped", "hexapod")
SECOND = {"quadruped": "back_left_shoulder", "hexapod": "middle_left_hip"}
"""The joint that is jammed in cases 7 and 8 of Table I."""

COMPARATORS = (
    *("forward-displacement", "paper-sensors", "sensor-series", "gait-pattern"),
    *("noisy-transfer", "segment-prediction", "segment-prediction-onboard"),
)
PAPER = ("--kinds", "break,jam,sensor")
TINY = ("--population", "12", "--generations", "3")
COMMON = ("--threads", "1", "--json")
Command = tuple[str, ...]


@dataclass(frozen=True)
class Scenario:
    """Commands that run in one folder.

    Attributes:
        name: Unique name, ``PART/...``.
        commands: Arguments of ``python -m selfmodel`` by the command's name, in order.
    """

    name: str
    commands: dict[str, Command]


def scenarios(material: Path | None) -> tuple[Scenario, ...]:
    """Returns all scenarios, in the order of ``PARTS``.

    Args:
        material: Folder of ``python -m benchmarks.foreign generate``; without it, the recordings of
            an independent simulation are left out.
    """
    foreign = [] if material is None else _foreign(material.resolve())
    return (
        *(*_trials(), *_replays(), *_models(), *_imports(), *_calibrations()),
        *(*_diagnoses(), *foreign, *_recoveries(), *_commands()),
    )


def damages(robot: str) -> tuple[str, ...]:
    """Returns the ten cases of Table I in notation."""
    upper, second = "shoulder" if robot == "quadruped" else "hip", SECOND[robot]
    broken, touch = f"break:front_left_{upper}", "sensor:front_right_touch"
    return (
        *("break:front_left_knee", broken, "sensor:front_left_touch", f"{broken}+{touch}"),
        *("sensor:front_left_angle", f"jam:front_left_{upper}", f"{broken}+jam:{second}"),
        *(f"{broken}+jam:{second}+sensor:back_right_angle", "intact", "neuron:0"),
    )


def _trial(robot: str, out: str, *options: str) -> Command:
    return ("trial", robot, "--out", out, *options, "--json")


def _gait(robot: str, number: int) -> Command:
    return "--controller", str(BANK / f"{robot}-{number % 6}.npz")


def _trials() -> Iterator[Scenario]:
    for robot in ROBOTS:
        for case, damage in enumerate(damages(robot), 1):
            which = ("--damage", damage, "--seed", str(case), *_gait(robot, case))
            command = _trial(robot, "trial.mcap", *which)
            yield Scenario(f"trials/{robot}-case{case:02d}", {"trial": command})
        others: dict[str, Command] = {
            "network": (),
            "cpg": ("--controller", "cpg"),
            "neurons": ("--neurons", "5"),
            "gap": ("--gap", "0.05", "--damage", "break:front_left_knee", *_gait(robot, 0)),
            "ground": ("--damage", "friction=0.5+roughness=0.02+slope=0.1", *_gait(robot, 2)),
            "wind": ("--damage", "wind=10.0+sensor:back_left_angle=noise0.4", *_gait(robot, 3)),
            "motor": ("--damage", "motor:back_left_knee=0.5", "--gap", "0.05", *_gait(robot, 4)),
            "gain": ("--damage", "sensor:back_left_angle=gain0.5", *_gait(robot, 5)),
        }
        for name, options in others.items():
            command = _trial(robot, "trial.mcap", *options, "--seed", "11")
            replay = ("replay", "trial.mcap", *COMMON)
            yield Scenario(f"trials/{robot}-{name}", {"trial": command, "replay": replay})


def _replays() -> Iterator[Scenario]:
    for path in sorted(DATA.rglob("*.mcap")):
        if path.parent.name in ("bag", "damaged"):  # a bag, and a log to salvage
            continue
        name = path.relative_to(DATA).with_suffix("").as_posix()
        read = {"info": ("logs", "info", str(path), "--json")}
        yield Scenario(f"replays/{name}", {**read, "replay": ("replay", str(path), *COMMON)})
    damaged = str(DATA / "damaged" / "trial.mcap")
    salvage = ("logs", "salvage", damaged, "--out", "salvaged.mcap", "--json")
    yield Scenario("replays/damaged", {"salvage": salvage})


def _models() -> Iterator[Scenario]:
    """Trials of bodies of dm_control's suite and of MJCF files of others: their compiled models."""
    short = ("--steps", "40", "--seed", "2")
    suite = ("walker-walk", "cheetah-run", "quadruped-walk", "hopper-hop", "humanoid-run")
    for name in (*suite, "fish-swim", "swimmer-swimmer6", "dog-run"):
        yield Scenario(f"models/{name}", {"trial": _trial(f"suite-{name}", "trial.mcap", *short)})
    for name in ("ant", "half_cheetah", "walker2d_v5", "humanoid", "hopper"):
        model = str(MODELS / f"{name}.xml")
        yield Scenario(f"models/gymnasium-{name}", {"trial": _trial(model, "trial.mcap", *short)})
    tripod = str(DATA / "mjcf" / "tripod.xml")
    yield Scenario("models/tripod", {"trial": _trial(tripod, "trial.mcap", *short)})
    go2 = SAMPLES / "go2-stand" / "go2.xml"
    if go2.exists():
        settings = ("--set", "base=fixed", "--set", "kp=20", "--set", "kd=1.5")
        yield Scenario("models/go2", {"trial": _trial(str(go2), "trial.mcap", *settings, *short)})


def _imports() -> Iterator[Scenario]:
    imported = DATA / "imported"
    bag = ("logs", "import", str(imported / "bag"), "--mapping", str(imported / "map.toml"))
    yield Scenario("imports/bag", {"import": (*bag, "--out", "bag.mcap", "--json")})
    suggest = ("logs", "import", str(imported / "bag"), "--suggest", "--robot", "quadruped")
    yield Scenario("imports/suggest-bag", {"suggest": suggest})
    jitter = SAMPLES / "synthetic_rosbag2_humble_jitter_gap.mcap"
    if jitter.exists():
        suggest = ("logs", "import", str(jitter), "--suggest", "--robot", "quadruped")
        yield Scenario("imports/suggest-jitter", {"suggest": suggest})
    for form in ("csv", "npz", "parquet"):
        out = f"table.{form}"
        export = ("logs", "export", "trial.mcap", "--out", out)
        suggest = ("logs", "import", out, "--suggest", "--robot", "quadruped")
        trial = _trial("quadruped", "trial.mcap", "--steps", "200", "--seed", "5")
        commands = {"trial": trial, "export": export, "suggest": suggest}
        yield Scenario(f"imports/export-{form}", commands)


def _pair(
    robot: str, damage: str, *options: str, gait: int = 0, steps: int = 400
) -> dict[str, Command]:
    """Returns the commands of a healthy trial and of one with a failure, in one reality gap."""
    common = ("--steps", str(steps), *_gait(robot, gait), *options)
    return {
        "before": _trial(robot, "before.mcap", "--stage", "before", "--seed", "3", *common),
        "after": _trial(robot, "after.mcap", "--damage", damage, "--seed", "4", *common),
    }


def _calibrations() -> Iterator[Scenario]:
    for robot, gap in itertools.product(ROBOTS, ("0.0", "0.05", "0.2")):
        commands = _pair(robot, "intact", "--gap", gap, steps=600)
        logs = ("before.mcap",) if gap == "0.0" else ("before.mcap", "after.mcap")
        commands["calibrate"] = ("calibrate", *logs, "--out", "model.xml", *COMMON)
        yield Scenario(f"calibrations/{robot}-gap{gap}", commands)
    go2 = SAMPLES / "go2-stand" / "go2.xml"
    if go2.exists():
        settings = ("--set", "base=fixed", "--set", "kp=20", "--set", "kd=1.5")
        trial = ("--gap", "0.1", "--steps", "400", "--controller", "cpg", "--seed", "3")
        commands = {"before": _trial(str(go2), "before.mcap", *settings, *trial)}
        commands["calibrate"] = ("calibrate", "before.mcap", "--out", "model.xml", *COMMON)
        yield Scenario("calibrations/fixed-base", commands)


def _diagnosis(*options: str) -> Command:
    return ("diagnose", "before.mcap", "after.mcap", *options, *TINY, *COMMON)


def _diagnoses() -> Iterator[Scenario]:
    for robot in ROBOTS:
        for case in (1, 2, 3, 4, 5, 6, 7, 8, 9):
            commands = _pair(robot, damages(robot)[case - 1], "--gap", "0.05", gait=case)
            commands["diagnose"] = _diagnosis(*PAPER)
            yield Scenario(f"diagnoses/{robot}-case{case:02d}", commands)
        commands = _pair(robot, damages(robot)[6], "--gap", "0.1")
        for name in COMPARATORS:
            commands[name] = _diagnosis(*PAPER, "--comparator", name)
        commands["uncalibrated"] = _diagnosis(*PAPER, "--no-calibrate")
        commands["without-healthy"] = ("diagnose", "after.mcap", *PAPER, *TINY, *COMMON)
        yield Scenario(f"diagnoses/{robot}-comparators", commands)
    others = {
        "friction": ("friction=0.4", "0.1"),
        "slope": ("slope=0.12", "0.05"),
        "wind": ("wind=10.0", "0.05"),
        "payload": ("payload=0.3", "0.05"),
        "motor-half": ("motor:back_left_knee=0.5", "0.05"),
        "motor-mild": ("motor:back_left_knee=0.9", "0.05"),
        "jam-angle": ("jam:back_left_shoulder=0.3", "0.05"),
        "motor-slope": ("motor:back_left_knee=0.4+slope=0.1", "0.1"),
        "break-friction": ("break:front_left_shoulder+friction=0.4", "0.1"),
        "intact-gap0": ("intact", "0.0"),
        "intact-gap2": ("intact", "0.2"),
        "case08-gap1": (damages("quadruped")[7], "0.1"),
        "neuron": ("neuron:0", "0.05"),
    }
    for name, (damage, gap) in others.items():
        commands = _pair("quadruped", damage, "--gap", gap, gait=2)
        commands["diagnose"] = _diagnosis()
        yield Scenario(f"diagnoses/quadruped-{name}", commands)
    commands = _pair("quadruped", "roughness=0.03+break:front_left_knee", gait=1)
    commands["diagnose"] = _diagnosis("--kinds", "break,roughness")
    yield Scenario("diagnoses/quadruped-roughness", commands)
    commands = _pair("quadruped", "sensor:back_left_angle=gain0.5", "--gap", "0.05", gait=1)
    commands["diagnose"] = _diagnosis("--kinds", "all")
    yield Scenario("diagnoses/quadruped-all-kinds", commands)
    for seed in (0, 1, 2, 3):
        commands = _pair("quadruped", damages("quadruped")[7], "--gap", "0.1", steps=600)
        commands["diagnose"] = _diagnosis(*PAPER, "--seed", str(seed))
        yield Scenario(f"diagnoses/quadruped-case08-seed{seed}", commands)
    walker = ("--steps", "300", "--gap", "0.05")
    yield Scenario(
        "diagnoses/walker",
        {
            "before": _trial("suite-walker-walk", "before.mcap", *walker, "--stage", "before"),
            "after": _trial(
                "suite-walker-walk", "after.mcap", *walker, "--damage", "break:left_ankle"
            ),
            "diagnose": _diagnosis(),
        },
    )


def _foreign(material: Path) -> Iterator[Scenario]:
    for truth in sorted(material.glob("*/truth.json")):
        commands: dict[str, Command] = {}
        for name in ("before", "after-1"):
            source, mapping = truth.parent / name, truth.parent / f"{name}.toml"
            out = ("--out", f"{name}.mcap", "--json")
            commands[name] = ("logs", "import", str(source), "--mapping", str(mapping), *out)
        commands["diagnose"] = ("diagnose", "before.mcap", "after-1.mcap", *TINY, *COMMON)
        yield Scenario(f"foreign/{truth.parent.name}", commands)


def _recoveries() -> Iterator[Scenario]:
    paper = ("--repair", "paper", "--population", "20", "--generations", "5", *PAPER)
    robust = ("--repair", "robust", "--population", "20", "--generations", "4")
    runs: dict[str, tuple[str, Command]] = {
        "quadruped-paper": ("quadruped", ("--case", "1", *paper)),
        "quadruped-paper-gap": ("quadruped", ("--case", "7", "--gap", "0.1", *paper)),
        "hexapod-paper": ("hexapod", ("--case", "2", *paper)),
        "quadruped-robust": ("quadruped", ("--case", "2", "--gap", "0.1", *robust)),
        "hexapod-robust": ("hexapod", ("--case", "2", "--gap", "0.1", *robust)),
        "quadruped-disagreement": (
            "quadruped",
            ("--case", "3", "--next-trial", "disagreement", *paper),
        ),
    }
    for name, (robot, options) in runs.items():
        command = ("recover", robot, *options, "--trials", "2", "--out", "run", *COMMON)
        yield Scenario(f"recoveries/{name}", {"recover": command})


def _commands() -> Iterator[Scenario]:
    yield Scenario("commands/robots", {"robots": ("robots", "--json")})
    trial = _trial("quadruped", "trial.mcap", "--steps", "200")
    verify = ("logs", "verify", "trial.mcap", "--json")
    yield Scenario("commands/logs", {"trial": trial, "verify": verify})
    grid = ("--steps", "100", "--population", "8", "--generations", "2", "--seeds", "2")
    ablate = (
        *(
            "ablate",
            "--robots",
            "quadruped",
            "--comparator",
            "forward-displacement,segment-prediction",
        ),
        *("--case", "1", *grid, "--out", "study", "--workers", "1", "--json"),
    )
    yield Scenario("commands/ablate", {"ablate": ablate})
