"""Option types and the code behind them, shared by several commands."""
