"""The page of `thumper setup`: from a bare board, or none, to a saved map."""
