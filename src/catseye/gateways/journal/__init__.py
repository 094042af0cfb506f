"""A journal on the way out: tables, FITS, a campaign."""
