"""Writers for pages, figures, JSON, FITS and tables; files are written atomically."""
