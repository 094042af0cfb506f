"""Structural model used: tables, text, figures and files of the commands of `catseye model`."""
