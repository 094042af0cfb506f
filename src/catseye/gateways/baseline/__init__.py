"""An EDM baseline on the way out."""
