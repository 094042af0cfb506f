"""The page of a site, a result or a journal: addresses, the child beside a site, `view`."""
