"""Tracks of points that another program has found in a clip; one module for each program's file format.

To add a format, add a module that defines ``FORMAT``, a `anglecam.io.tracks.tracks_format.TracksFormat`, and its test.
Nothing else changes: `anglecam.io.tracks.files` finds every module of this package that defines ``FORMAT``.
"""
