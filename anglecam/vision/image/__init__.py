"""What the other rooms do with pixels: transforms, noise, medians, clusters."""
