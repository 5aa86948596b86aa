"""Options of the repair: how controllers are evolved, and for what."""

from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.arguments.options import CONTROLLER, SEARCH

_SCORES = (
    "Fitness of controllers: displacement; upright, the displacement until the first fall; energy, "
    "that less the work of the joints; return, the sum of the task's rewards; tracking, the error "
    "of the joints from a trajectory; or package.module:object."
)
RepairName = Annotated[
    str,
    typer.Option(
        metavar="robust|paper",
        help="Evolve controllers on rollouts with noise and with the uncertainty of the self-model;"
        " or as the paper does, in one exact simulation.",
        rich_help_panel=SEARCH,
    ),
]
SearchName = Annotated[
    str | None,
    typer.Option(
        metavar="cma-es|ea|repertoire",
        help="Search of the robust repair: CMA-ES with raced starts, the paper's EA, or CMA-ES "
        "that starts from gaits of a repertoire.",
        show_default="cma-es; ea with --repair paper; repertoire with --repertoire",
        rich_help_panel=SEARCH,
    ),
]
StudySearch = Annotated[
    str | None,
    typer.Option(
        "--search",
        metavar="cma-es|ea",
        help="Search of the robust repair: CMA-ES with raced starts, or the paper's EA.",
        show_default="cma-es; ea with --repair paper",
        rich_help_panel=SEARCH,
    ),
]
RepertoireFile = Annotated[
    Path | None,
    typer.Option(
        "--repertoire",
        metavar="FILE",
        help="Gaits of the healthy robot, made by `selfmodel repertoire make`.",
        rich_help_panel=SEARCH,
    ),
]
StudyScore = Annotated[
    str | None,
    typer.Option(
        "--score",
        metavar="NAME",
        help=_SCORES,
        show_default="displacement; upright with --repair robust",
        rich_help_panel=CONTROLLER,
    ),
]
RecoveryScore = Annotated[
    str | None,
    typer.Option(
        "--score",
        metavar="NAME",
        help=_SCORES,
        show_default="upright; displacement with --repair paper",
        rich_help_panel=CONTROLLER,
    ),
]
Reference = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Trajectory to follow with --score tracking: LOG.mcap, or a table (.csv, .npz, "
        ".parquet) with the columns time and joints.",
        show_default="the motion of a first controller with random weights",
        rich_help_panel=CONTROLLER,
    ),
]
MaxJointSpeed = Annotated[
    float | None,
    typer.Option(
        metavar="RAD/S",
        help="With --score upright: displacement counts while no joint is faster.",
        rich_help_panel=CONTROLLER,
    ),
]
MaxJointTorque = Annotated[
    float | None,
    typer.Option(
        metavar="NM",
        help="With --score upright: displacement counts while no joint has a larger torque.",
        rich_help_panel=CONTROLLER,
    ),
]
MaxSelfCollision = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="With --score upright: displacement counts until two bodies of the robot, apart from "
        "neighbours, penetrate each other deeper.",
        rich_help_panel=CONTROLLER,
    ),
]
