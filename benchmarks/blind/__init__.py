"""The loop against truths that it has not seen: sessions drawn by seed, as series and as films."""
