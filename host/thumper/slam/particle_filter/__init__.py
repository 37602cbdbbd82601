"""The Rao-Blackwellised particle filter with copy-on-write patches."""
