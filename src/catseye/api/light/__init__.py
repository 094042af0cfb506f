"""`import catseye`: stray light of a range."""
