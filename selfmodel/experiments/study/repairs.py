"""Repair of a study: the names of repair, search and score, which are parameters of the cells."""

from selfmodel import plugins
from selfmodel.errors import InputError


def check_repair(repair: str, search: str | None) -> None:
    """Checks the names of the repair of a study and of its search.

    Args:
        repair: ``robust`` or ``paper``.
        search: ``cma-es`` or ``ea``; None for that of the repair.

    Raises:
        InputError: A name is unknown, the paper's repair is to have another search, or the search
            needs a repertoire, which a study does not have.
    """
    if search == plugins.REPERTOIRE:
        raise InputError(
            f"a repertoire is of one robot, and a study of many has none, got --search {search}: "
            f"give --search {' or '.join(plugins.SEARCHES)}, or recover one robot with `selfmodel "
            f"recover --repertoire FILE`"
        )
    plugins.repair(repair, search)


def repair_parameters(repair: str, search: str | None) -> dict[str, str]:
    """Returns the parameters of cells that determine their repair, as JSON.

    Args:
        repair: ``robust`` or ``paper``.
        search: Name of the search; None for that of the repair, which is then the same cell.
    """
    return {"repair": repair, "search": plugins.search_name(repair, search, None)}


def score_name(repair: str, score: str | None) -> str:
    """Returns the name of the score of a study, by default that of its repair."""
    return score or plugins.DEFAULT_SCORES[repair]
