"""Maps beside the frames: how they are made, named, kept, and written to the disk."""
