"""What benchmarks and tests share: synthetic rooms, drives and messages, and programs to start."""
