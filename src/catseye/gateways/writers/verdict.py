"""One word on a result and why: the same on a terminal, on top of a page, in JSON and in an exit status."""

from html import escape
from typing import Literal, NamedTuple

Word = Literal["good", "doubtful", "failed"]

SIGNS: dict[str, str] = {"good": "✓", "doubtful": "?", "failed": "✗"}  # beside the colour, for who cannot see it


class Verdict(NamedTuple):
    """Whether a result may be relied on.

    word   "good"; "doubtful": an answer that something speaks against or nothing checks; "failed": no answer, or one
           that its own tests reject
    why    one sentence without its full stop, beginning in lower case
    """

    word: Word
    why: str

    @property
    def text(self) -> str:
        """The verdict as a line.

        >>> Verdict("doubtful", "nothing was measured twice").text
        'Doubtful: nothing was measured twice.'
        """
        return f"{self.word.capitalize()}: {self.why}."

    def to_object(self) -> dict[str, str]:
        """As `verdict` in every `--json`."""
        return {"word": self.word, "why": self.why}


def worst(verdicts: list[Verdict]) -> Verdict:
    """The worst of several, the first of equals; good of none.

    >>> worst([Verdict("good", "a"), Verdict("failed", "b"), Verdict("doubtful", "c")]).why
    'b'
    """
    order = list(SIGNS)
    return max(verdicts, key=lambda v: order.index(v.word), default=Verdict("good", "there is nothing to judge"))


def verdict_line(verdict: Verdict) -> str:
    """The verdict as the first line of a page, HTML."""
    word = f"<b>{SIGNS[verdict.word]} {verdict.word.capitalize()}</b>"
    return f'<p class="verdict {verdict.word}">{word}: {escape(verdict.why)}.</p>'
