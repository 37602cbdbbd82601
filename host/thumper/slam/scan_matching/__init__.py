"""Scan-to-grid matching: kernels, options, covariance, degeneracy."""
