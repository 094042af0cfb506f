"""Functions of movements between epochs."""
