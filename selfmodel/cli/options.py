"""The options that several commands share, so that they read the same everywhere."""

from pathlib import Path
from typing import Annotated

import typer

from selfmodel.errors import InputError
from selfmodel.faults.registry import ALL_KINDS, PAPER_KINDS
from selfmodel.trials.trial import STAGES

RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT|ROBOT.xml",
        help="One of those that `selfmodel robots` lists, or an MJCF of your own.",
    ),
]
ModelSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="What ROBOT.xml does not tell, such as forward=-x; as in ROBOT.toml beside it.",
    ),
]
Damage = Annotated[
    str | None,
    typer.Option(
        metavar="NOTATION",
        help="What is wrong, such as break:front_left_knee or "
        "jam:back_left_shoulder+sensor:front_right_touch.",
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Every random choice comes from it.")]
GapLevel = Annotated[
    float,
    typer.Option(
        "--gap",
        metavar="LEVEL",
        help="How far the physical robot is from its model, 0 to 0.5: 0.05 is 5 % in masses and "
        "motors, and as much noise.",
    ),
]
Structural = Annotated[
    bool,
    typer.Option(
        "--structure",
        help="Let the physical robot also have backlash, a soft limb, a foot of another size and a "
        "weak motor.",
    ),
]
Threads = Annotated[
    int,
    typer.Option(min=0, max=1024, help="Threads for the physics; 0 means one for each processor."),
]
RobotOrModel = Annotated[
    str | None,
    typer.Option(
        "--robot",
        metavar="NAME|MODEL.xml",
        help="The self-model to use in the place of the one in the logs.",
    ),
]
ComparatorName = Annotated[
    str,
    typer.Option(
        metavar="NAME|package.module:object",
        help="How a simulation is compared with a logged trial.",
    ),
]
Calibrated = Annotated[
    bool,
    typer.Option(
        "--calibrate/--no-calibrate",
        help="Fit the self-model to the trials before the failure, if there are any.",
    ),
]
Population = Annotated[int, typer.Option(min=2, max=10_000, help="Genomes in a generation.")]
Generations = Annotated[int, typer.Option(min=1, max=10_000, help="Generations of each EA.")]
KindNames = Annotated[
    str,
    typer.Option(
        "--kinds",
        metavar="KIND,...",
        help="What may be wrong, as far as a diagnosis considers it: some of "
        f"{', '.join(kind.name for kind in ALL_KINDS)}, or package.module:object; or all.",
    ),
]
NamedKinds = Annotated[
    str,
    typer.Option(
        "--kinds",
        metavar="package.module:object,...",
        help="Kinds of your own that notation may name, beside all that come with selfmodel.",
        show_default=False,
    ),
]
DEFAULT_KINDS = ",".join(kind.name for kind in PAPER_KINDS)
ControllerKind = Annotated[
    str,
    typer.Option(
        "--controller",
        metavar="network|cpg",
        help="What is evolved: the paper's network, or a central pattern generator, one "
        "oscillator a motor.",
    ),
]
Neurons = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=100,
        help="Hidden neurons of the network.",
        show_default="3",
    ),
]
NextTrialName = Annotated[
    str,
    typer.Option(
        metavar="repair|disagreement",
        help="How the next trial is chosen: to restore the function, or, as long as hypotheses "
        "cannot be told apart, to tell them apart.",
    ),
]
StageName = Annotated[
    str,
    typer.Option(
        "--stage",
        metavar="|".join(STAGES),
        help="Where in a story the trial stands; before: the failure. `selfmodel diagnose` fits "
        "the self-model to those, and explains all others.",
    ),
]
LogFiles = Annotated[list[Path], typer.Argument(metavar="FILE...", help="Trial logs, NAME.mcap.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


def check_log_name(path: Path) -> None:
    """Checks the name of a log that is to be written.

    Raises:
        InputError: It does not end in ``.mcap``.
    """
    if path.suffix != ".mcap":
        raise InputError(f"--out needs a name that ends in .mcap, got {str(path)!r}")
