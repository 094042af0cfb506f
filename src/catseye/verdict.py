"""One word on a result and why, and how it passes from a result to what rests on it."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple, Optional

Word = Literal["good", "doubtful", "failed"]
ORDER: tuple[Word, ...] = ("good", "doubtful", "failed")  # from the best to the worst


class Verdict(NamedTuple):
    """Judgement of a result.

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

    def hearing(self, doubts: Sequence[str]) -> "Verdict":
        """The same, doubtful where it was good and a note says that something is wrong.

        doubts   notes that speak against the result; others are not for a verdict

        >>> Verdict("good", "all fits").hearing(["WX2's thermometer is biased."]).text
        "Doubtful: WX2's thermometer is biased."
        """
        return Verdict("doubtful", doubts[0].rstrip(".")) if doubts and self.word == "good" else self

    def resting_on(self, sources: Mapping[str, Optional["Verdict"]]) -> "Verdict":
        """The same, or the worst of its sources: a result is no better than what it rests on.

        sources   verdict of each result that was read, by its name; None: it has none

        >>> Verdict("good", "all fits").resting_on({"night-07": Verdict("failed", "it did not settle")}).text
        'Failed: it rests on night-07, which failed: it did not settle.'
        """
        judged = {name: verdict for name, verdict in sources.items() if verdict is not None}
        name = max(judged, key=lambda each: ORDER.index(judged[each].word), default="")
        if not name or ORDER.index(judged[name].word) <= ORDER.index(self.word):
            return self
        word, why = judged[name]
        others = sum(verdict.word == word for verdict in judged.values()) - 1
        more = f" (and {others} more)" if others else ""
        return Verdict(word, f"it rests on {name}, which {'failed' if word == 'failed' else f'is {word}'}: {why}{more}")


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """The worst of several, the first of equals; good of none.

    >>> worst([Verdict("good", "a"), Verdict("failed", "b"), Verdict("doubtful", "c")]).why
    'b'
    """
    return max(verdicts, key=lambda v: ORDER.index(v.word), default=Verdict("good", "there is nothing to judge"))
