"""The commands `thumper tune`, `thumper experiment` and `thumper calibrate`, and the page's experiments."""

from thumper_tuning.cli.tune import app

__all__ = ["app"]
