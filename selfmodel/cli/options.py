"""The options that several commands share, so that they read the same everywhere."""

from typing import Annotated

import typer

RobotName = Annotated[
    str, typer.Argument(metavar="ROBOT", help="One of those that `selfmodel robots` lists.")
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
Threads = Annotated[
    int,
    typer.Option(min=0, max=1024, help="Threads for the physics; 0 means one for each processor."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
