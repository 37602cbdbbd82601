"""Maps from recorded logs; readers of public formats."""
