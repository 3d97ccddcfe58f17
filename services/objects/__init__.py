"""Object stores that speak S3: where a home may lie instead of a folder.

``address`` (``s3://bucket/prefix``) → ``access`` (endpoint, region and credentials out of the
environment) and ``faults`` (what a store's answers mean) → ``store`` (single objects) → ``probe``
(does the store keep two writers apart?).
"""
