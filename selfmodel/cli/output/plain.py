"""Text from files, made harmless for a terminal: a log's names may hold anything."""


def plain(text: str) -> str:
    """Returns text with every character that a terminal would act on written out."""
    return "".join(
        char if char.isprintable() or char == "\n" else char.encode("unicode_escape").decode()
        for char in text
    )
