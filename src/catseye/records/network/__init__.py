"""Network files: TOML, STAR*NET, GNU Gama, a folder of tables."""
