"""Doctests of the page are collected only where the packages of its extra are installed."""

from importlib.util import find_spec

PACKAGES = ("fastapi", "uvicorn", "websockets", "prometheus_client")
collect_ignore_glob = [] if all(map(find_spec, PACKAGES)) else ["src/catseye/web/*"]
