"""The figures of ``anglecam neck``: each a function of a verb's result and of the file to write."""
