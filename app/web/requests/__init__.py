"""What requests may say, and what of it is refused."""
