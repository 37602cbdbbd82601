"""Results as text, as figures, and as one HTML page."""
