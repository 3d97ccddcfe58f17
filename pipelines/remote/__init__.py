"""Work that is sent to a Ray cluster from outside: ``lmtr submit``, ``jobs``, ``logs``, ``cancel``.

``target`` (which cluster, with which token and home) → ``versions`` (are its programs ours) →
``submission`` (what is sent) → ``watch`` (how it goes on) → ``tables`` (what there is to see).
A submitted job is the ordinary command on the cluster's head, so all that it does is in the stages.
"""
