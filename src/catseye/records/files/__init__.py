"""Record types, file readers, and error messages for invalid files."""
