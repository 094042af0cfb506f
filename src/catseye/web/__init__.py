"""A site, a journal or a result in a browser: JSON API, WebSocket of events, metrics, static files."""
