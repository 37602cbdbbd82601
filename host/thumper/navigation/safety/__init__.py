"""The last checks of a command: smoother, collision monitor, escape."""
