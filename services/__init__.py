"""Services that know nothing of quadrupeds: home, lakehouse, cluster, tracking.

Nothing here imports ``lmtr`` or ``pipelines``.
"""
