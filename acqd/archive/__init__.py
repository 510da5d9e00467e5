"""Every sample of a daemon, lossless, in a ring of files on disk: written, repaired, read, exported."""
