"""The experiment that would separate models which the recordings cannot tell apart."""
