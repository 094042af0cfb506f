"""Answers from an archive of nights, judged."""
