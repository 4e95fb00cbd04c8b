"""What turns in a film: explanations of its pictures compete, and the best one is followed through all frames."""
