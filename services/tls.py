"""What went wrong with encryption, in words that name the mend."""

import ssl


def tls_fault(error: ssl.SSLError) -> tuple[str, str]:
    """Cause and mend of a connection that could not be encrypted."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return (
            f"its certificate is not trusted: {error.verify_message}",
            "name a file with its authority's certificate in SSL_CERT_FILE (for MLflow also in "
            "MLFLOW_TRACKING_SERVER_CERT_PATH), or call it by the name that is in the certificate",
        )
    return (
        f"no encrypted connection: {(error.reason or str(error)).replace('_', ' ').lower()}",
        "write http:// if it does not speak TLS",
    )
