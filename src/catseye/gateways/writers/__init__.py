"""How anything is written: pages, figures, JSON, FITS, tables, whole or not at all. Knows no subject."""
