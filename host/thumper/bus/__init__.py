"""Zenoh transport: topics out, requests in."""
