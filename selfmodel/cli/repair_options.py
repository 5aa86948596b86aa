"""Options of the repair: how controllers are evolved, and for what."""

from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.options import CONTROLLER, SEARCH

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
        metavar="cma-es|ea",
        help="Search of the robust repair: CMA-ES with raced starts, or the paper's EA.",
        show_default="cma-es; ea with --repair paper",
        rich_help_panel=SEARCH,
    ),
]
ScoreName = Annotated[
    str,
    typer.Option(
        "--score",
        metavar="NAME",
        help=_SCORES,
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
