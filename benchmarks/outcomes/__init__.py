"""What becomes of every film and session of the benchmarks, stored, and compared with what became of them before."""
