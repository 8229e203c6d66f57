"""What is answered, as JSON or as files."""
