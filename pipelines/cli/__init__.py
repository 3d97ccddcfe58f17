"""The command line ``lmtr``: it parses, calls a stage, and renders what came out."""

from pipelines.cli.app import main

__all__ = ["main"]
