"""What people look at: figures, the report page, the summary in the terminal."""
