"""Fenced code blocks of Markdown pages, for the tests that run them."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(
    r"(?:^<!-- (?P<comment>.*?) -->\n)?^```(?P<language>\S*) ?(?P<argument>.*)\n"
    r"(?P<text>(?:.*\n)*?)^```$",
    flags=re.MULTILINE,
)


@dataclass(frozen=True)
class Block:
    """Fenced block of a page.

    Attributes:
        line: Number of the line of the opening fence, from 1.
        language: Word after the fence, such as ``sh`` or ``{literalinclude}``.
        argument: Rest of that line.
        text: Content.
        comment: HTML comment on the line before, such as ``not run: ...`` or ``file: NAME``.
    """

    line: int
    language: str
    argument: str
    text: str
    comment: str

    @property
    def is_run(self) -> bool:
        """Whether the block is Python or commands, without the comment ``not run: ...``."""
        return self.language in ("sh", "python") and not self.comment.startswith("not run: ")


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            text.count("\n", 0, match.start("language")) + 1,
            match["language"],
            match["argument"],
            match["text"],
            match["comment"] or "",
        )
        for match in FENCE.finditer(text)
    ]


def commands(block: Block) -> list[list[str]]:
    """The commands of a block as lists of arguments, without comments and empty lines."""
    lines = block.text.replace("\\\n", " ").splitlines()
    words = [shlex.split(line, comments=True) for line in lines]
    return [arguments for arguments in words if arguments]
