"""A package, so that the running robot ends with the tests of this folder."""
