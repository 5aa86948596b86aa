"""The commands whose results ``benchmarks.same_bits`` compares.

A scenario is a list of commands that run one after the other in an empty folder. The first part of
its name is the part of the comparison that the scenario belongs to.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
BANK = ROOT / "benchmarks" / "bank"
"""Evolved gaits, the same files for every version."""

PARTS = ("trials", "diagnoses", "recoveries", "demo", "table-one")
ROBOTS = ("quadruped", "hexapod")
SECOND = {"quadruped": "back_left_shoulder", "hexapod": "middle_left_hip"}
"""The joint that is jammed in cases 7 and 8 of Table I."""

COMPARATORS = (
    "forward-displacement",
    "paper-sensors",
    "sensor-series",
    "gait-pattern",
    "noisy-transfer",
    "segment-prediction",
    "segment-prediction-onboard",
)
PAPER = ("--kinds", "break,jam,sensor")
"""The kinds of version 0.1 by default, which has no names of sets."""

KINDS = (
    "break,jam,sensor,jam-angle,motor,sensor-gain,sensor-bias,sensor-noise,"
    "friction,slope,roughness,wind,crosswind"
)
TINY = ("--population", "12", "--generations", "3", "--trials", "1")
SMALL = ("--population", "20", "--generations", "5", "--trials", "2")
COMMON = ("--threads", "1", "--json")
TABLE_ONE_SEEDS = range(10)
TABLE_ONE_BY_SEED = (1, 2, 3, 5, 6, 9)
"""Cases that ``docs/results.jsonl`` has with every seed of the quadruped."""


@dataclass(frozen=True)
class Scenario:
    """Commands that run in one folder.

    Attributes:
        name: Unique name, ``PART/...``.
        commands: Arguments of ``python -m selfmodel`` by the command's name, in order.
    """

    name: str
    commands: dict[str, tuple[str, ...]]


def scenarios() -> tuple[Scenario, ...]:
    """Returns all scenarios, in the order of ``PARTS``."""
    return (*_trials(), *_diagnoses(), *_recoveries(), _demo(), *_table_one())


def damages(robot: str) -> tuple[str, ...]:
    """Returns the ten cases of Table I in notation."""
    upper, second = "shoulder" if robot == "quadruped" else "hip", SECOND[robot]
    broken, touch = f"break:front_left_{upper}", "sensor:front_right_touch"
    return (
        "break:front_left_knee",
        broken,
        "sensor:front_left_touch",
        f"{broken}+{touch}",
        "sensor:front_left_angle",
        f"jam:front_left_{upper}",
        f"{broken}+jam:{second}",
        f"{broken}+jam:{second}+sensor:back_right_angle",
        "intact",
        "neuron:0",
    )


def _trial(robot: str, out: str, *options: str) -> tuple[str, ...]:
    return ("trial", robot, "--out", out, *options, "--json")


def _gait(robot: str, number: int) -> tuple[str, str]:
    return "--controller", str(BANK / f"{robot}-{number % 6}.npz")


def _trials() -> Iterator[Scenario]:
    for robot in ROBOTS:
        for case, damage in enumerate(damages(robot), 1):
            which = ("--damage", damage, "--seed", str(case), *_gait(robot, case))
            name = f"trials/{robot}-case{case:02d}"
            yield Scenario(name, {"trial": _trial(robot, "trial.mcap", *which)})
        others: dict[str, tuple[str, ...]] = {
            "network": (),
            "cpg": ("--controller", "cpg"),
            "neurons": ("--neurons", "5"),
            "gap": ("--gap", "0.05", "--damage", "break:front_left_knee", *_gait(robot, 0)),
            "structure": ("--gap", "0.2", "--structure", *_gait(robot, 1)),
            "ground": ("--damage", "friction=0.5+roughness=0.02+slope=0.1", *_gait(robot, 2)),
            "wind": ("--damage", "wind=10.0+sensor:back_left_angle=noise0.4", *_gait(robot, 3)),
            "motor": ("--damage", "motor:back_left_knee=0.5", "--gap", "0.05", *_gait(robot, 4)),
            "gain": ("--damage", "sensor:back_left_angle=gain0.5", *_gait(robot, 5)),
        }
        for name, options in others.items():
            command = _trial(robot, "trial.mcap", *options, "--seed", "11")
            replay = ("replay", "trial.mcap", *COMMON)
            yield Scenario(f"trials/{robot}-{name}", {"trial": command, "replay": replay})
    walker = _trial("suite-walker-walk", "trial.mcap", "--damage", "break:left_ankle")
    yield Scenario("trials/suite-walker-walk", {"trial": walker})


def _diagnoses() -> Iterator[Scenario]:
    for robot in ROBOTS:
        before, after = _before_and_after(robot)
        full = ("diagnose", "before.mcap", "after.mcap", *PAPER, *COMMON)
        yield Scenario(
            f"diagnoses/{robot}",
            {
                "before": before,
                "after": after,
                "default": full,
                "uncalibrated": (*full, "--no-calibrate"),
                "without-healthy": ("diagnose", "after.mcap", *PAPER, *COMMON),
            },
        )
        yield Scenario(
            f"diagnoses/{robot}-gap",
            {
                "before": (*before, "--gap", "0.05"),
                "after": (*after, "--gap", "0.05"),
                "calibrate": ("calibrate", "before.mcap", "--out", "model.xml", *COMMON),
                "default": full,
            },
        )
        # The settings of a diagnosis are those of the logs: a small recovery makes small ones.
        logs = ("run/trials/00-before.mcap", "run/trials/01-after.mcap")
        diagnose = ("diagnose", *logs, *COMMON)
        yield Scenario(
            f"diagnoses/{robot}-comparators",
            {
                "recover": (
                    "recover",
                    robot,
                    "--case",
                    "6",
                    *TINY,
                    *PAPER,
                    *COMMON,
                    "--out",
                    "run",
                ),
                **{name: (*diagnose, *PAPER, "--comparator", name) for name in COMPARATORS},
                "kinds": (*diagnose, "--kinds", KINDS),
            },
        )


def _before_and_after(robot: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    gait = (*_gait(robot, 0), "--seed", "3")
    return (
        _trial(robot, "before.mcap", "--stage", "before", *gait),
        _trial(robot, "after.mcap", "--damage", damages(robot)[6], *gait),
    )


def _recover(robot: str, *options: str) -> dict[str, tuple[str, ...]]:
    return {"recover": ("recover", robot, *options, *PAPER, "--out", "run", "--json")}


def _recoveries() -> Iterator[Scenario]:
    for robot in ROBOTS:
        for case in range(1, 11):
            command = _recover(robot, "--case", str(case), *TINY, "--threads", "1")
            yield Scenario(f"recoveries/{robot}-case{case:02d}", command)
    others = {
        "cpg": ("--case", "1", "--controller", "cpg"),
        "neurons": ("--case", "6", "--neurons", "5"),
        "disagreement": ("--case", "3", "--next-trial", "disagreement"),
        "gap": ("--case", "7", "--gap", "0.1"),
        "structure": ("--case", "2", "--gap", "0.05", "--structure"),
        "displacement": ("--case", "8", "--comparator", "forward-displacement"),
        "threads": ("--case", "5", "--seed", "4"),
    }
    for name, options in others.items():
        threads = "2" if name == "threads" else "1"
        command = _recover("quadruped", *options, *SMALL, "--threads", threads)
        yield Scenario(f"recoveries/quadruped-{name}", command)
    walker = _recover("suite-walker-walk", "--case", "1", *TINY, "--threads", "1")
    yield Scenario("recoveries/suite-walker-walk", walker)


def _demo() -> Scenario:
    return Scenario("demo/quadruped-case01", _recover("quadruped", "--case", "1"))


def _table_one() -> Iterator[Scenario]:
    runs = [(robot, case, 0) for robot in ROBOTS for case in range(1, 11)]
    runs += [
        ("quadruped", case, seed) for seed in TABLE_ONE_SEEDS if seed for case in TABLE_ONE_BY_SEED
    ]
    for robot, case, seed in runs:
        which = ("--case", str(case), "--seed", str(seed))
        options = (*which, "--comparator", "forward-displacement", "--threads", "1")
        yield Scenario(table_one_name(robot, case, seed), _recover(robot, *options))


def table_one_name(robot: str, case: int, seed: int) -> str:
    """Returns the name of a run of Table I."""
    return f"table-one/{robot}-case{case:02d}-seed{seed}"
