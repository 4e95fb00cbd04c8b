"""Every file format, one door each: what is read is validated here, and nothing inside checks it again."""
