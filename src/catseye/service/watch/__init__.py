"""Watch of a site: state from its coordinator's port, history from its journal."""
