"""Rows of an archive by DuckDB: a few of many, and plain SQL."""
