"""What a dataset consists of, drawn; run by ``benchmarks/data_figures.py``."""
