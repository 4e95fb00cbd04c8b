"""Reading and writing of every file format, one module each. Content is validated here and nowhere else."""
