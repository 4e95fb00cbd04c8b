"""Folders of clips: every clip measured once, on one machine or many, and an index that says what became of each."""
