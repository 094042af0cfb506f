"""Kinds of observation, one file each; `kinds` names them all."""
