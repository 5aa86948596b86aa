"""Rows of studies as outcomes, for the statistics: what is compared, and what is a pair."""

from collections.abc import Sequence

from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.baseline.results import AFTER, BaselineRow
from selfmodel.experiments.paper.rows import RecoveryRow
from selfmodel.experiments.statistics import Outcome
from selfmodel.recovery.baselines.registry import ORACLE


def of_ablation(rows: Sequence[AblationRow]) -> tuple[Outcome, ...]:
    """Returns right (1) and wrong (0) diagnoses by comparator.

    The tables are those of a robot and a number of trials: over all gaps, then each gap alone. A
    pair has the robot, the failure, the gap, the seed and the way of the trials in common.
    """
    gaps = sorted({row.gap for row in rows})
    chosen = [None, *gaps] if len(gaps) > 1 else [None]
    return tuple(
        Outcome(
            table=(
                row.robot,
                _counted(row.trials),
                *(() if gap is None else (f"gap {gap:g}",)),
            ),
            method=row.comparator,
            cell=(f"gap {row.gap:g}", row.failure, row.next_trial),
            seed=row.seed,
            value=float(row.correct),
            measure="share",
        )
        for gap in chosen
        for row in rows
        if gap in (None, row.gap)
    )


def of_baselines(rows: Sequence[BaselineRow]) -> tuple[Outcome, ...]:
    """Returns displacements by method, m, and divided by the oracle's on the same physical robot.

    The tables are those of a robot, a number of physical trials and a unit. There is none after
    more trials than any method had on the robot. A pair has the robot, the case, the gap and the
    seed in common. The oracle is a bound, and is not compared.
    """
    compared = [row for row in rows if row.method != ORACLE]
    longest: dict[str, int] = {}
    for row in compared:
        longest[row.robot] = max(longest.get(row.robot, 0), len(row.best))
    oracles = {
        (row.robot, row.case, row.gap, row.seed): row.value(1)
        for row in rows
        if row.method == ORACLE
    }
    found = []
    for trials in AFTER:
        for row in compared:
            if trials > longest[row.robot]:
                continue
            value = row.value(trials)
            values = {"m": value}
            oracle = oracles.get((row.robot, row.case, row.gap, row.seed), 0.0)
            if oracle > 0:
                values["÷ oracle"] = value / oracle
            found += [
                Outcome(
                    table=(row.robot, f"after {_counted(trials)}", unit),
                    method=row.method,
                    cell=(f"gap {row.gap:g}", f"{row.case:2d}"),
                    seed=row.seed,
                    value=number,
                    measure="number",
                )
                for unit, number in values.items()
            ]
    return tuple(found)


def of_paper(rows: Sequence[RecoveryRow]) -> tuple[Outcome, ...]:
    """Returns right (1) and wrong (0) diagnoses, and recovered displacements, by comparator.

    The tables are those of a robot and a measure. A pair has the robot, the case and the seed in
    common.
    """
    found = []
    for row in rows:
        run = (row.comparator, (f"{row.case:2d}",), row.seed)
        found += [
            Outcome((row.robot, "right"), *run, float(row.correct), "share"),
            Outcome((row.robot, "recovered, m"), *run, row.recovered, "number"),
        ]
    return tuple(found)


def _counted(trials: int) -> str:
    return f"{trials} {'trial' if trials == 1 else 'trials'}"
