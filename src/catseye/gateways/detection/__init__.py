"""Texts, tables and figures of detection."""
