"""Verdict as the first line of a page; see `catseye.verdict`."""

from html import escape

from catseye.verdict import Verdict, Word, worst

__all__ = ["SIGNS", "Verdict", "Word", "verdict_line", "worst"]

SIGNS: dict[str, str] = {"good": "✓", "doubtful": "?", "failed": "✗"}  # for colour-blind readers


def verdict_line(verdict: Verdict) -> str:
    """Verdict as the first line of a page, HTML."""
    word = f"<b>{SIGNS[verdict.word]} {verdict.word.capitalize()}</b>"
    return f'<p class="verdict {verdict.word}">{word}: {escape(verdict.why)}.</p>'
