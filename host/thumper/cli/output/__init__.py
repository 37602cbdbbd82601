"""What commands print and write: progress, output folders, reports."""
