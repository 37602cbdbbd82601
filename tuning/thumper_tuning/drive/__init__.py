"""Experiments on a board: excitation, recording, verification, gains."""
