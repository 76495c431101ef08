"""What a server acknowledged is there after any death of it, and runs end as if undisturbed."""
