"""The ways out: results as files, tables, figures and pages, whole or not at all."""
