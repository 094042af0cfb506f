"""Answers from an archive: tables, figures, sentences, objects."""
