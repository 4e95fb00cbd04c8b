"""Folders of clips: every clip is measured once, on one machine or several, and an index states each outcome."""
