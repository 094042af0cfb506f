"""Verdict on a result, with its reason, and its propagation to dependent results."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple, Optional

Word = Literal["good", "doubtful", "failed"]
ORDER: tuple[Word, ...] = ("good", "doubtful", "failed")  # from the best to the worst


class Verdict(NamedTuple):
    """Judgement of a result.

    word   "good"; "doubtful": a result with an objection or without a check; "failed": no result, or one rejected
           by its own tests
    why    one sentence without full stop, in lower case
    """

    word: Word
    why: str

    @property
    def text(self) -> str:
        """Verdict as a line.

        >>> Verdict("doubtful", "nothing was measured twice").text
        'Doubtful: nothing was measured twice.'
        """
        return f"{self.word.capitalize()}: {self.why}."

    def to_object(self) -> dict[str, str]:
        """Object for `verdict` in every `--json`."""
        return {"word": self.word, "why": self.why}

    def hearing(self, doubts: Sequence[str]) -> "Verdict":
        """Verdict made doubtful if it was good and there are doubts.

        doubts   notes that question the result; no others

        >>> Verdict("good", "all fits").hearing(["WX2's thermometer is biased."]).text
        "Doubtful: WX2's thermometer is biased."
        """
        return Verdict("doubtful", doubts[0].rstrip(".")) if doubts and self.word == "good" else self

    def resting_on(self, sources: Mapping[str, Optional["Verdict"]]) -> "Verdict":
        """Verdict limited by its sources: a result is no better than its inputs.

        sources   verdict of each input result, by name; None if it has none

        >>> Verdict("good", "all fits").resting_on({"night-07": Verdict("failed", "it did not settle")}).text
        'Failed: it rests on night-07, which failed: it did not settle.'
        """
        judged = {name: verdict for name, verdict in sources.items() if verdict is not None}
        name = max(judged, key=lambda each: ORDER.index(judged[each].word), default="")
        if not name or ORDER.index(judged[name].word) <= ORDER.index(self.word):
            return self
        word, why = judged[name]
        further = sum(verdict.word == word for verdict in judged.values()) - 1
        more = f" (and {further} more)" if further else ""
        return Verdict(word, f"it rests on {name}, which {'failed' if word == 'failed' else f'is {word}'}: {why}{more}")


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """Worst of several verdicts, the first of equals; good for none.

    >>> worst([Verdict("good", "a"), Verdict("failed", "b"), Verdict("doubtful", "c")]).why
    'b'
    """
    return max(verdicts, key=lambda v: ORDER.index(v.word), default=Verdict("good", "there is nothing to judge"))
