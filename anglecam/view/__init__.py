"""A local page on which one sees, clicks and saves: a small server for one folder, for the person at this machine."""
