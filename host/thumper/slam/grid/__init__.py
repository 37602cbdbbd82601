"""The mapper with one map and one hypothesis; branch-and-bound search."""
