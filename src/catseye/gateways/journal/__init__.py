"""Output of a journal: tables, FITS, a campaign."""
