"""Sheets and tables of the laboratory and the survey."""
