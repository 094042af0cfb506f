"""The panel setting instrument on the way out."""
