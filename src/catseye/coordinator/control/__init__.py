"""Parameters that can be set while a site is measured: registry, checks of a whole set, activation."""
