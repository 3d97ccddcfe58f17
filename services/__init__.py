"""Services that know nothing of quadrupeds: lakehouse, cluster, tracking, planner.

Nothing here imports ``lmtr`` or ``pipelines``.
"""
