"""Read motor logs of any format into one clean form."""
