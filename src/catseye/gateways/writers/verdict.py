"""A verdict as the first line of a page; `catseye.verdict` says what it is."""

from html import escape

from catseye.verdict import Verdict, Word, worst

__all__ = ["SIGNS", "Verdict", "Word", "verdict_line", "worst"]

SIGNS: dict[str, str] = {"good": "✓", "doubtful": "?", "failed": "✗"}  # beside the colour, for who cannot see it


def verdict_line(verdict: Verdict) -> str:
    """The verdict as the first line of a page, HTML."""
    word = f"<b>{SIGNS[verdict.word]} {verdict.word.capitalize()}</b>"
    return f'<p class="verdict {verdict.word}">{word}: {escape(verdict.why)}.</p>'
