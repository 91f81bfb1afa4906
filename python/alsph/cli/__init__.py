"""The command line."""

from alsph.cli.app import app, main

__all__ = ["app", "main"]
