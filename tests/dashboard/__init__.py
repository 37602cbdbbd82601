"""A package, so that server, robot and browser end with the tests of this folder."""
