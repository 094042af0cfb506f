"""Texts, objects and figures of scans and searches."""
