"""Effects of the air stream, and of what it does to body and tail."""
