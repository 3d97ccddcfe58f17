"""``python -m pipelines`` is the command line ``lmtr``."""

from pipelines.cli import main

main()
