"""What runs on the services: each stage joins the science of ``lmtr`` to ``services``.

Data flows one way: task → expert → lake → segments → model → rollout → report.
"""
