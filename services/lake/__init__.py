"""The lakehouse: Delta Lake tables, read with SQL.

``schemas`` (what the tables hold) → ``checks`` (rows against their schema) and ``sandbox``
(DuckDB, shut off from files and network) → ``tables`` (append, read, time travel) → ``queries``
(SQL from people, and its result as a file).
"""
