"""Design studies as sentences, objects, tables, figures and report."""
