"""Numbers of whole nights."""
