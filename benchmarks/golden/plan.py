"""The commands whose results ``benchmarks.golden`` records and compares.

A scenario is a list of commands that run one after the other in an empty folder. The first part of
its name is the part of the comparison that it belongs to.
"""

import itertools
from collections.abc import Iterator
from pathlib import Path

import gymnasium

ROOT = Path(__file__).parents[2]
BANK = ROOT / "benchmarks" / "bank"
"""Evolved gaits, the same files for every version."""

DATA = ROOT / "tests" / "data" / "logs-0.1"
"""Logs of version 0.1."""

SAMPLES = ROOT.parent / "shared" / "samples"
"""Recordings that are not in the repository; scenarios of those that are missing are left out."""

GO2 = SAMPLES / "go2-stand" / "go2.xml"
MODELS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
ROBOTS = ("quadruped", "hexapod")
COMPARATORS = (
    *("forward-displacement", "paper-sensors", "sensor-series", "gait-pattern"),
    *("noisy-transfer", "segment-prediction", "segment-prediction-onboard"),
)
PAPER = "--kinds break,jam,sensor"
TINY = "--population 12 --generations 3"
COMMON = "--threads 1 --json"

Commands = dict[str, str]
"""Arguments of ``python -m selfmodel`` by the command's name, in order; no path has a space."""

Scenario = tuple[str, Commands]
"""Unique name, ``PART/...``, and the commands that run in one folder."""


def scenarios(material: Path | None) -> tuple[Scenario, ...]:
    """Returns all scenarios; those of an independent simulation with its folder as material only.

    The folder is that of ``python -m benchmarks.foreign generate``.
    """
    foreign = () if material is None else _foreign(material.resolve())
    return (
        *(*_trials(), *_replays(), *_models(), *_imports(), *_calibrations()),
        *(*_diagnoses(), *foreign, *_recoveries(), *_commands()),
    )


def damages(robot: str) -> tuple[str, ...]:
    """Returns the ten cases of Table I in notation."""
    upper, second = {
        "quadruped": ("shoulder", "back_left_shoulder"),
        "hexapod": ("hip", "middle_left_hip"),
    }[robot]
    broken = f"break:front_left_{upper}"
    return (
        *("break:front_left_knee", broken, "sensor:front_left_touch"),
        *(f"{broken}+sensor:front_right_touch", "sensor:front_left_angle"),
        *(f"jam:front_left_{upper}", f"{broken}+jam:{second}"),
        *(f"{broken}+jam:{second}+sensor:back_right_angle", "intact", "neuron:0"),
    )


def _trial(robot: object, options: str, out: str = "trial.mcap") -> str:
    return f"trial {robot} --out {out} {options} --json"


def _gait(robot: str, number: int) -> str:
    return f"--controller {BANK / f'{robot}-{number % 6}.npz'}"


def _trials() -> Iterator[Scenario]:
    for robot in ROBOTS:
        for case, damage in enumerate(damages(robot), 1):
            options = f"--damage {damage} --seed {case} {_gait(robot, case)}"
            yield f"trials/{robot}-case{case:02d}", {"trial": _trial(robot, options)}
        others = {
            "network": "",
            "cpg": "--controller cpg",
            "neurons": "--neurons 5",
            "gap": f"--gap 0.05 --damage break:front_left_knee {_gait(robot, 0)}",
            "ground": f"--damage friction=0.5+roughness=0.02+slope=0.1 {_gait(robot, 2)}",
            "wind": f"--damage wind=10.0+sensor:back_left_angle=noise0.4 {_gait(robot, 3)}",
            "motor": f"--damage motor:back_left_knee=0.5 --gap 0.05 {_gait(robot, 4)}",
            "gain": f"--damage sensor:back_left_angle=gain0.5 {_gait(robot, 5)}",
        }
        for name, options in others.items():
            replay = f"replay trial.mcap {COMMON}"
            trial = _trial(robot, f"{options} --seed 11")
            yield f"trials/{robot}-{name}", {"trial": trial, "replay": replay}


def _replays() -> Iterator[Scenario]:
    for path in sorted(DATA.rglob("*.mcap")):
        if path.parent.name in ("bag", "damaged"):  # a bag, and a log to salvage
            continue
        name = path.relative_to(DATA).with_suffix("").as_posix()
        info, replay = f"logs info {path} --json", f"replay {path} {COMMON}"
        yield f"replays/{name}", {"info": info, "replay": replay}
    damaged = DATA / "damaged" / "trial.mcap"
    yield "replays/damaged", {"salvage": f"logs salvage {damaged} --out salvaged.mcap --json"}


def _models() -> Iterator[Scenario]:
    """Trials of bodies of dm_control's suite and of MJCF files of others: their compiled models."""
    suite = ("walker-walk", "cheetah-run", "quadruped-walk", "hopper-hop", "humanoid-run")
    models: dict[str, object] = {
        name: f"suite-{name}" for name in (*suite, "fish-swim", "swimmer-swimmer6", "dog-run")
    }
    for name in ("ant", "half_cheetah", "walker2d_v5", "humanoid", "hopper"):
        models[f"gymnasium-{name}"] = MODELS / f"{name}.xml"
    models["tripod"] = DATA / "mjcf" / "tripod.xml"
    if GO2.exists():
        models["go2"] = f"{GO2} --set base=fixed --set kp=20 --set kd=1.5"
    for name, model in models.items():
        yield f"models/{name}", {"trial": _trial(model, "--steps 40 --seed 2")}


def _imports() -> Iterator[Scenario]:
    bag, mapping = DATA / "imported" / "bag", DATA / "imported" / "map.toml"
    imported = f"logs import {bag} --mapping {mapping} --out bag.mcap --json"
    yield "imports/bag", {"import": imported}
    suggest = "logs import {} --suggest --robot quadruped"
    yield "imports/suggest-bag", {"suggest": suggest.format(bag)}
    jitter = SAMPLES / "synthetic_rosbag2_humble_jitter_gap.mcap"
    if jitter.exists():
        yield "imports/suggest-jitter", {"suggest": suggest.format(jitter)}
    for form in ("csv", "npz", "parquet"):
        commands = {
            "trial": _trial("quadruped", "--steps 200 --seed 5"),
            "export": f"logs export trial.mcap --out table.{form}",
            "suggest": suggest.format(f"table.{form}"),
        }
        yield f"imports/export-{form}", commands


def _pair(robot: str, damage: str, options: str, gait: int = 0, steps: int = 400) -> Commands:
    """Returns the commands of a healthy trial and of one with a failure, each in its own gap."""
    common = f"--steps {steps} {_gait(robot, gait)} {options}"
    before, after = f"--stage before --seed 3 {common}", f"--damage {damage} --seed 4 {common}"
    return {
        "before": _trial(robot, before, "before.mcap"),
        "after": _trial(robot, after, "after.mcap"),
    }


def _calibrations() -> Iterator[Scenario]:
    calibrate = f"calibrate {{}} --out model.xml {COMMON}"
    for robot, gap in itertools.product(ROBOTS, ("0.0", "0.05", "0.2")):
        logs = "before.mcap" if gap == "0.0" else "before.mcap after.mcap"
        commands = _pair(robot, "intact", f"--gap {gap}", steps=600)
        yield (
            f"calibrations/{robot}-gap{gap}",
            {**commands, "calibrate": calibrate.format(logs)},
        )
    if GO2.exists():
        options = "--set base=fixed --set kp=20 --set kd=1.5 --gap 0.1 --steps 400"
        before = _trial(GO2, f"{options} --controller cpg --seed 3", "before.mcap")
        commands = {"before": before, "calibrate": calibrate.format("before.mcap")}
        yield "calibrations/fixed-base", commands


def _diagnosis(options: str = "") -> str:
    return f"diagnose before.mcap after.mcap {options} {TINY} {COMMON}"


def _diagnoses() -> Iterator[Scenario]:
    for robot in ROBOTS:
        for case, damage in enumerate(damages(robot)[:9], 1):
            commands = _pair(robot, damage, "--gap 0.05", gait=case)
            commands["diagnose"] = _diagnosis(PAPER)
            yield f"diagnoses/{robot}-case{case:02d}", commands
        commands = _pair(robot, damages(robot)[6], "--gap 0.1")
        for name in COMPARATORS:
            commands[name] = _diagnosis(f"{PAPER} --comparator {name}")
        commands["uncalibrated"] = _diagnosis(f"{PAPER} --no-calibrate")
        commands["without-healthy"] = f"diagnose after.mcap {PAPER} {TINY} {COMMON}"
        yield f"diagnoses/{robot}-comparators", commands
    case08 = damages("quadruped")[7]
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
        "case08-gap1": (case08, "0.1"),
        "neuron": ("neuron:0", "0.05"),
    }
    for name, (damage, gap) in others.items():
        commands = _pair("quadruped", damage, f"--gap {gap}", gait=2)
        yield f"diagnoses/quadruped-{name}", {**commands, "diagnose": _diagnosis()}
    commands = _pair("quadruped", "roughness=0.03+break:front_left_knee", "", gait=1)
    commands["diagnose"] = _diagnosis("--kinds break,roughness")
    yield "diagnoses/quadruped-roughness", commands
    commands = _pair("quadruped", "sensor:back_left_angle=gain0.5", "--gap 0.05", gait=1)
    yield "diagnoses/quadruped-all-kinds", {**commands, "diagnose": _diagnosis("--kinds all")}
    for seed in (0, 1, 2, 3):
        commands = _pair("quadruped", case08, "--gap 0.1", steps=600)
        commands["diagnose"] = _diagnosis(f"{PAPER} --seed {seed}")
        yield f"diagnoses/quadruped-case08-seed{seed}", commands
    walker, options = "suite-walker-walk", "--steps 300 --gap 0.05"
    yield (
        "diagnoses/walker",
        {
            "before": _trial(walker, f"{options} --stage before", "before.mcap"),
            "after": _trial(walker, f"{options} --damage break:left_ankle", "after.mcap"),
            "diagnose": _diagnosis(),
        },
    )


def _foreign(material: Path) -> Iterator[Scenario]:
    for truth in sorted(material.glob("*/truth.json")):
        commands = {
            name: f"logs import {truth.parent / name} --mapping {truth.parent / f'{name}.toml'} "
            f"--out {name}.mcap --json"
            for name in ("before", "after-1")
        }
        commands["diagnose"] = f"diagnose before.mcap after-1.mcap {TINY} {COMMON}"
        yield f"foreign/{truth.parent.name}", commands


def _recoveries() -> Iterator[Scenario]:
    paper = f"--repair paper --population 20 --generations 5 {PAPER}"
    robust = "--repair robust --population 20 --generations 4"
    runs = {
        "quadruped-paper": f"quadruped --case 1 {paper}",
        "quadruped-paper-gap": f"quadruped --case 7 --gap 0.1 {paper}",
        "hexapod-paper": f"hexapod --case 2 {paper}",
        "quadruped-robust": f"quadruped --case 2 --gap 0.1 {robust}",
        "hexapod-robust": f"hexapod --case 2 --gap 0.1 {robust}",
        "quadruped-disagreement": f"quadruped --case 3 --next-trial disagreement {paper}",
    }
    for name, options in runs.items():
        yield f"recoveries/{name}", {"recover": f"recover {options} --trials 2 --out run {COMMON}"}


def _commands() -> Iterator[Scenario]:
    yield "commands/robots", {"robots": "robots --json"}
    trial = _trial("quadruped", "--steps 200")
    yield "commands/logs", {"trial": trial, "verify": "logs verify trial.mcap --json"}
    small = "--steps 100 --population 8 --generations 2 --workers 1 --json"
    ablate = (
        "ablate --robots quadruped --comparator forward-displacement,segment-prediction --case 1 "
        f"--repair paper --seeds 2 --out study {small}"
    )
    yield "commands/ablate", {"ablate": ablate, "compare": "compare study --json"}
    displacement = "--case 1 --comparator forward-displacement --trials 1 --out study"
    suite = f"suite run --domains walker --repair paper {displacement} {small}"
    yield "commands/suite", {"suite": suite}
    yield "commands/paper", {"paper": f"paper --robots quadruped {displacement} {small}"}
