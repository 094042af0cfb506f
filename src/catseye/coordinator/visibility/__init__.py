"""Which ranger sees which target from where it stands."""
