"""Records that no site has, in the words of the mistake, before any adjustment."""
